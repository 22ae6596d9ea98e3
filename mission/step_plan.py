"""Which steps is a vehicle asked to fly, and what did it make of each of them? Values; pure; local ned."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.types import F64
from sitl.truth_log import TruthRow
from sitl.world import World

ABSENT: Final = math.nan
SHORTEST, LONGEST = 0.1, 0.9  # rise time: from 10 to 90 %


@dataclass(frozen=True, slots=True)
class Ask:
    """A setpoint from ``t_s`` on, after OFFBOARD began; NaN: not controlled."""

    t_s: float
    pos_ned_m: tuple[float, float, float]
    vel_ned_m_s: tuple[float, float, float] = (ABSENT, ABSENT, ABSENT)
    yaw_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Step:
    """One step: when it comes, how large it is, which column of a track shows it."""

    name: str
    unit: str
    t_s: float
    size: float
    column: int

    def response(self, track: F64) -> tuple[F64, F64]:
        """Seconds since the step, and the response as a part of its size."""
        now = (track[:, 0] >= self.t_s) & (track[:, 0] < self.t_s + WATCH_S)
        before = np.interp(self.t_s, track[:, 0], track[:, self.column])
        return track[now, 0] - self.t_s, (track[now, self.column] - before) / self.size


T, EAST, UP, YAW, SPEED = range(5)  # columns of a track
WATCH_S: Final = 6.0
HOVER, ASIDE, ABOVE = (0.0, 0.0, -5.0), (0.0, 2.0, -5.0), (0.0, 2.0, -7.0)
ASKS: Final = (
    Ask(0.0, HOVER),
    Ask(12.0, ASIDE),
    Ask(18.0, ABOVE),
    Ask(24.0, ABOVE, yaw_rad=math.pi / 2),
    Ask(30.0, ABOVE),
    Ask(36.0, (ABSENT, ABSENT, ABOVE[2]), (5.0, 0.0, ABSENT)),
    Ask(43.0, (ABSENT, ABSENT, ABOVE[2]), (0.0, 0.0, ABSENT)),
)
END_S: Final = 48.0
STEPS: Final = (
    Step("2 m aside", "m", 12.0, 2.0, EAST),
    Step("2 m up", "m", 18.0, 2.0, UP),
    Step("90 deg of yaw", "rad", 24.0, math.pi / 2, YAW),
    Step("5 m/s", "m/s", 36.0, 5.0, SPEED),
)


def ask_at(t_s: float) -> Ask:
    """What is asked for at this time."""
    return [ask for ask in ASKS if ask.t_s <= max(t_s, 0.0)][-1]


def track_of(rows: list[TruthRow], began_s: float) -> F64:
    """Truth as a track (n, 5): time since OFFBOARD began, east, up, yaw (continuous), speed north."""
    truths = [row.truth for row in rows]
    yaw = np.unwrap([yaw_rad(truth.q_ned_frd) for truth in truths])
    columns = [
        [truth.t_s - began_s for truth in truths],
        [truth.pos_ned_m[1] for truth in truths],
        [-truth.pos_ned_m[2] for truth in truths],
        yaw,
        [truth.vel_ned_m_s[0] for truth in truths],
    ]
    return np.array(columns, dtype=np.float64).T


def rise_and_overshoot(t_s: F64, part: F64) -> tuple[float, float]:
    """Rise time from 10 to 90 %, s, and by how much the size of the step is overshot, a part of it."""
    return _reaches(t_s, part, LONGEST) - _reaches(t_s, part, SHORTEST), max(0.0, float(part.max()) - 1.0)


def _reaches(t_s: F64, part: F64, level: float) -> float:
    """When the level is first reached, between samples; NaN when never."""
    after = int(np.argmax(part >= level))
    if part[after] < level:
        return math.nan
    before = max(after - 1, 0)
    return float(np.interp(level, part[[before, after]], t_s[[before, after]]))


def open_world() -> World:
    """Nothing to hit."""
    far_m = 500.0
    bounds = (-far_m, -far_m, far_m, far_m)
    return World("open", np.zeros(2), np.array([30.0, 0.0]), bounds, np.zeros((0, 4)), np.zeros((0, 6)))
