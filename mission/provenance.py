"""Which code was it, and on which machine? What goes beside every figure."""

import os
import platform
import subprocess
from pathlib import Path


def machine() -> str:
    """Where this runs, and how busy that was: wall times of decisions depend on both."""
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores when begun"
    return f"{platform.system()} {platform.machine()}, Python {platform.python_version()}, {load}"


def commit() -> str:
    """Of the checkout that this runs from, '+' when it was changed since; 'unknown' outside of one."""
    here = Path(__file__).parent
    try:
        found = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--exclude=*"],
            cwd=here,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return found.stdout.strip()
