"""What can somebody who watches be told, and how does a run end? Values."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any


class ExitCode(IntEnum):
    """How the process ends; 128 + signal number when it was told to stop."""

    LANDED = 0
    BAD_INPUT = 2
    NO_VEHICLE = 3
    VEHICLE_LOST = 4
    TICK_FAILED = 5
    UNFIT = 6  # what ``--check`` found


@dataclass(frozen=True, slots=True)
class StatusLine:
    """The flight in one line, a few times a second."""

    t_s: float
    mode: str
    goal_distance_m: float | None
    d_min_m: float | None
    s_fuzzy: float | None
    tick_ms: float

    def __str__(self) -> str:
        """For a terminal."""
        return (
            f"{self.t_s:7.2f} s  {self.mode:<8} goal {_figure(self.goal_distance_m)} m  "
            f"d_min {_figure(self.d_min_m)} m  S {_figure(self.s_fuzzy)}  tick {self.tick_ms:.1f} ms"
        )


@dataclass(frozen=True, slots=True)
class Summary:
    """What is printed at the end with ``--json``."""

    exit_code: int
    reason: str
    ticks: int
    record_sha256: str
    log_dir: str


def status_line(row: Mapping[str, Any], tick_ms: float) -> StatusLine:
    """From the record of a tick; what it does not have stays away."""
    return StatusLine(
        t_s=row.get("t_s", 0.0),
        mode=str(row.get("mode", "")),
        goal_distance_m=row.get("goal_distance_m"),
        d_min_m=row.get("d_min_m"),
        s_fuzzy=row.get("s_fuzzy"),
        tick_ms=tick_ms,
    )


def _figure(value: float | None) -> str:
    return "    -" if value is None else f"{value:5.2f}"
