"""Where should the vehicle go, how high, how fast? A value; local ned."""

from dataclasses import dataclass

from companion.core.types import F64


@dataclass(frozen=True, slots=True)
class Task:
    """One flight from here to a goal."""

    goal_ned_m: F64  # (2,) north, east
    down_m: float | None  # cruise altitude; None: the one at the first tick in OFFBOARD
    cruise_m_s: float  # cap of the horizontal speed
