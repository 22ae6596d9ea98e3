"""What does a person see of a flight while it happens?  A live panel on a terminal, plain lines elsewhere.

Reads the end of the navigator's log as it grows; nothing of this goes over the vehicle's links.
"""

import json
import sys
import time
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from mission.judge import Result

REFRESH_HZ = 8.0
LINE_EVERY_S = 2.0  # wall time between two status lines where there is no terminal
EVENTS_SHOWN = 6
MODE_STYLES = {"standby": "dim", "travel": "blue", "rl": "dark_orange", "landing": "green", "hold": "red"}
MODE_WORDS = {"standby": "standby", "travel": "Travel", "rl": "RL", "landing": "Landing", "hold": "Hold"}


class LogTail:
    """The newest whole line of a growing JSON-lines file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._part = b""
        self.row: dict[str, Any] | None = None

    def read(self) -> dict[str, Any] | None:
        """The newest row; the one before when nothing was added."""
        if not self._path.is_file():
            return self.row
        with self._path.open("rb") as file:
            file.seek(self._offset)
            added = file.read()
        self._offset += len(added)
        *whole, self._part = (self._part + added).split(b"\n")
        if whole:
            self.row = json.loads(whole[-1])
        return self.row


class FlightConsole:
    """Shows events and the navigator's last row; ``quiet`` shows nothing."""

    def __init__(self, title: str, tail: LogTail, quiet: bool = False, console: Console | None = None) -> None:
        self._title = title
        self._tail = tail
        self._quiet = quiet
        self._console = console or Console(file=sys.stdout, highlight=False)
        self._events: deque[str] = deque(maxlen=EVENTS_SHOWN)
        self._start_m: float | None = None
        self._line_wall_s = 0.0
        self._live: Live | None = None
        if self._console.is_terminal and not quiet:
            self._live = Live(self._panel(), console=self._console, refresh_per_second=REFRESH_HZ, transient=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._live:
            self._live.start()
        elif not self._quiet:
            self._console.print(self._title)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the terminal as it was."""
        if self._live:
            self._live.stop()

    def say(self, event: str) -> None:
        """One event, one line."""
        self._events.append(event)
        if self._live:
            self._live.update(self._panel())
        elif not self._quiet:
            self._console.print(f"  {event}", markup=False)

    def refresh(self) -> None:
        """Show the navigator's newest row; cheap, to be called a few times a second."""
        row = self._tail.read()
        if row is not None and self._start_m is None and row["mode"] != "standby":
            self._start_m = row["goal_distance_m"]
        if self._live:
            self._live.update(self._panel())
        elif row is not None and not self._quiet and time.monotonic() - self._line_wall_s >= LINE_EVERY_S:
            self._line_wall_s = time.monotonic()
            self._console.print(f"  {status_line(row, self._progress(row))}", markup=False)

    def _progress(self, row: dict[str, Any]) -> float:
        if not self._start_m or row["goal_distance_m"] is None:
            return 0.0
        return min(1.0, max(0.0, 1.0 - float(row["goal_distance_m"]) / self._start_m))

    def _panel(self) -> Panel:
        row = self._tail.row
        body: list[Any] = []
        if row is not None:
            table = Table.grid(padding=(0, 3))
            cells = [
                Text(MODE_WORDS[row["mode"]], style=f"bold {MODE_STYLES[row['mode']]}"),
                *(Text.assemble((f"{label} ", "dim"), value) for label, value in _figures(row)),
            ]
            table.add_row(*cells)
            bar = Table.grid(padding=(0, 1))
            bar.add_row(ProgressBar(completed=100.0 * self._progress(row), width=60), f"{self._progress(row):4.0%}")
            body += [table, bar]
        body += [Text(event, style="dim") for event in self._events]
        return Panel(Group(*body), title=self._title, title_align="left", border_style="dim", width=100)


def status_line(row: dict[str, Any], progress: float) -> str:
    """The navigator's row for people."""
    figures = "  ".join(f"{label} {value}" for label, value in _figures(row))
    return f"{MODE_WORDS[row['mode']]:8} {figures}  {progress:4.0%}"


def print_result(result: Result, console: Console | None = None) -> None:
    """The verdict and its figures."""
    console = console or Console(highlight=False)
    style = "bold green" if result.success else "bold red"
    verdict = f"success: {result.reason}" if result.success else "failure"  # why: on stderr
    console.print(Text(verdict, style=style))
    table = Table.grid(padding=(0, 2))
    for label, value in _summary(result):
        table.add_row(Text(label, style="dim"), Text(value))
    console.print(table)


def _figures(row: dict[str, Any]) -> list[tuple[str, str]]:
    near = "clear" if row["d_min_m"] is None else f"{row['d_min_m']:.1f} m"
    score = "?" if row["s_fuzzy"] is None else f"{row['s_fuzzy']:.2f}"
    goal = "?" if row["goal_distance_m"] is None else f"{row['goal_distance_m']:.1f} m"
    return [("t", f"{row['t_s']:.1f} s"), ("score", score), ("d_min", near), ("goal", goal)]


def _summary(result: Result) -> list[tuple[str, str]]:
    ratio = "" if result.path_ratio is None else f" ({result.path_ratio:.2f} x the shortest)"
    tick = "" if result.tick_p99_ms is None else f"{result.tick_p50_ms:.2f} ms median, {result.tick_p99_ms:.2f} ms p99"
    rows = [
        ("time", f"{result.time_s:.1f} s"),
        ("path", f"{result.path_m:.1f} m{ratio}"),
        ("clearance", "" if result.min_clearance_m is None else f"{result.min_clearance_m:.2f} m at the least"),
        ("landing", "" if result.landing_error_m is None else f"{result.landing_error_m:.2f} m off"),
        ("switches", f"{result.switches} of at most {result.switches_bound}, {result.rl_decisions} RL decisions"),
        ("tick", tick),
        ("speed", "" if result.realtime_factor is None else f"{result.realtime_factor:.1f} x real time"),
        ("folder", result.log_dir),
    ]
    return [row for row in rows if row[1]]
