"""What does a person see while arms train?  A live table of arms on a terminal, a line a finished seed elsewhere."""

import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

from mission.reproduce.run import Task
from mission.training.fleet import Member

REFRESH_HZ = 2.0
LINE_EVERY_S = 30.0  # wall time between two reports where there is no terminal
STATES = ("waiting", "training", "done", "failed")


class ArmsView:
    """Shows how far the seeds of all arms are; ``quiet`` shows nothing."""

    def __init__(self, quiet: bool = False, console: Console | None = None) -> None:
        self._quiet = quiet
        self._console = console or Console(stderr=True, highlight=False, emoji=False)
        self._ended: set[tuple[str, int]] = set()
        self._line_wall_s = time.monotonic()
        self._live: Live | None = None
        if self._console.is_terminal and not quiet:
            self._live = Live(console=self._console, refresh_per_second=REFRESH_HZ, transient=True)

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the terminal as it was."""
        if self._live:
            self._live.stop()

    def update(self, members: Sequence[tuple[Task, Member]]) -> None:
        """Show how it stands; cheap, to be called often."""
        if self._live:
            self._live.update(arms_table(members))
        elif not self._quiet:
            self._lines(members)

    def _lines(self, members: Sequence[tuple[Task, Member]]) -> None:
        """Whoever has come to an end, and now and then everybody at work."""
        due = time.monotonic() - self._line_wall_s >= LINE_EVERY_S
        for task, member in members:
            ended = member.state in ("done", "failed") and (task.arm, task.seed) not in self._ended
            if ended or (due and member.state == "training"):
                self._console.print(f"  {task.arm} seed {task.seed} {member.state}{_standing(member)}", markup=False)
            if ended:
                self._ended.add((task.arm, task.seed))
        if due:
            self._line_wall_s = time.monotonic()


def arms_table(members: Sequence[tuple[Task, Member]]) -> Table:
    """One arm a row: how many of its seeds are where, and the seeds at work."""
    table = Table()
    for name in ("arm", *STATES, "at work"):
        table.add_column(name, justify="left" if name in ("arm", "at work") else "right")
    for arm in dict.fromkeys(task.arm for task, _ in members):
        own = [(task, member) for task, member in members if task.arm == arm]
        counts = [str(sum(member.state == state for _, member in own) or "") for state in STATES]
        work = [f"{task.seed}{_standing(member)}" for task, member in own if member.state in ("training", "failed")]
        table.add_row(arm, *counts, "\n".join(work))
    return table


def _standing(member: Member) -> str:
    if member.error:
        return f": {member.error}"
    if member.status is None:
        return ""
    progress = member.status.progress
    return f": {progress.successes} successes in {progress.episodes} episodes"
