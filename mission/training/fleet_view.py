"""What does a person see of a fleet?  A live table of all seeds on a terminal, a line now and then elsewhere."""

import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from mission.training.fleet import Member
from mission.training.status import Status

REFRESH_HZ = 4.0
LINE_EVERY_S = 15.0  # wall time between two reports where there is no terminal
STYLES = {"waiting": "dim", "training": "blue", "done": "green", "failed": "red"}
COLUMNS = ("seed", "", "episodes", "successes", "steps (15)", "return (15)", "decisions/s", "wall", "left")


class FleetView:
    """Shows the members of a fleet; ``quiet`` shows nothing."""

    def __init__(self, title: str, quiet: bool = False, console: Console | None = None) -> None:
        self._title = title
        self._quiet = quiet
        self._console = console or Console(file=sys.stdout, highlight=False)
        self._line_wall_s = 0.0
        self._states: dict[int, str] = {}
        self._live: Live | None = None
        if self._console.is_terminal and not quiet:
            self._live = Live(console=self._console, refresh_per_second=REFRESH_HZ, transient=True)

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

    def update(self, members: Sequence[Member]) -> None:
        """Show how it stands; cheap, to be called often."""
        if self._live:
            self._live.update(fleet_table(self._title, members))
        elif not self._quiet:
            self._lines(members)

    def _lines(self, members: Sequence[Member]) -> None:
        """Whoever has come to an end, and now and then everybody."""
        due = time.monotonic() - self._line_wall_s >= LINE_EVERY_S
        for member in members:
            news = self._states.get(member.seed) != member.state and member.state in ("done", "failed")
            if news or (due and member.state == "training" and member.status is not None):
                self._console.print(f"  {member_line(member)}", markup=False)
            self._states[member.seed] = member.state
        if due:
            self._line_wall_s = time.monotonic()


def fleet_table(title: str, members: Sequence[Member]) -> Table:
    """All seeds, one a row, and below what went wrong."""
    table = Table(title=title, title_justify="left")
    for name in COLUMNS:
        table.add_column(name, justify="left" if name == "" else "right")
    for member in members:
        state = Text(member.state, style=STYLES[member.state])
        table.add_row(str(member.seed), state, *_cells(member.status))
    table.caption = "\n".join(f"seed {m.seed}: {_trouble(m)}" for m in members if _trouble(m)) or None
    return table


def member_line(member: Member) -> str:
    """One seed for people."""
    if member.status is None:
        return f"seed {member.seed} {member.state}" + (f": {member.error}" if member.error else "")
    cells = zip(COLUMNS[2:], _cells(member.status), strict=True)
    figures = "  ".join(f"{name} {cell}" for name, cell in cells)
    trouble = f"  ({_trouble(member)})" if _trouble(member) else ""
    return f"seed {member.seed} {member.state}  {figures}{trouble}"


def _trouble(member: Member) -> str:
    return member.error or (member.status.note if member.status else "")


def _cells(status: Status | None) -> list[str]:
    if status is None:
        return [""] * (len(COLUMNS) - 2)
    left = "?" if status.time_left_s is None else _clock(status.time_left_s)
    return [
        str(status.progress.episodes),
        str(status.progress.successes),
        f"{status.steps_15:.0f}",
        f"{status.return_15:.0f}",
        f"{status.decisions_per_s:.1f}",
        _clock(status.wall_s),
        left,
    ]


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
