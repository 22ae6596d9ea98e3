"""How are vehicle and companion run as processes of their own, watched, and always ended?

Each gets a process group of its own, so that Ctrl-C reaches the runner alone, which then ends them in order.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

INSTANCE_MAX = 9  # PX4's ports of instance 10 run into the next range
ENDING_WALL_S = 5.0  # patience before a process that was asked to end is killed


@dataclass(slots=True)
class Child:
    """One process; what it prints goes to ``log``."""

    name: str
    log: Path
    process: subprocess.Popen[bytes]

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        return self.process.poll()

    def last_line(self) -> str:
        """The last thing it printed, or nothing."""
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
        except OSError:
            return ""
        return next((line.strip() for line in reversed(lines) if line.strip()), "")


class Children:
    """Processes in the order in which they are ended; leaving the context ends all of them."""

    def __init__(self) -> None:
        self._children: list[Child] = []

    def __enter__(self) -> Self:
        """Nothing runs yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End what still runs."""
        for child in self._children:
            self.end(child)

    def start(self, name: str, module: str, arguments: Sequence[str], log: Path) -> Child:
        """Run ``python -m module arguments`` with one thread for each numeric library."""
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        return self.start_program(name, [sys.executable, "-m", module, *arguments], log, threads)

    def start_program(
        self, name: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str], cwd: Path | None = None
    ) -> Child:
        """Run any program with ``environment`` on top of our own."""
        with log.open("wb") as out:
            process = subprocess.Popen(
                list(arguments),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment},
                cwd=cwd,
                start_new_session=True,
            )
        child = Child(name, log, process)
        self._children.append(child)
        return child

    def end(self, child: Child) -> None:
        """Ask to stop (logs get closed), insist after a while."""
        if child.exit_code is None:
            child.process.send_signal(signal.SIGINT)
        try:
            child.process.wait(ENDING_WALL_S)
        except subprocess.TimeoutExpired:
            child.process.kill()
            child.process.wait()


def wait_for_end(child: Child, wall_s: float) -> bool:
    """Give a process the time to end by itself."""
    deadline_s = time.monotonic() + wall_s
    while child.exit_code is None and time.monotonic() < deadline_s:
        time.sleep(0.01)
    return child.exit_code is not None
