"""How much memory has this process held at most?  Linux and macOS."""

import resource
import sys
from pathlib import Path

STATUS = Path("/proc/self/status")
PEAK_KEY = "VmHWM:"  # kB; unlike ru_maxrss it does not count what the parent held before the program was loaded


def peak_rss_mb() -> float:
    """Megabytes (1e6 bytes) of resident memory."""
    if STATUS.is_file():
        for line in STATUS.read_text(encoding="ascii").splitlines():
            if line.startswith(PEAK_KEY):
                return float(line.split()[1]) * 1024 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
