"""What stands where? Obstacles, start, goal and bounds as arrays in the world's ned frame; pure.

Obstacles are 2.5-D: upright cylinders (``circles``), upright boxes (``boxes``: walls and arcs are boxes too) and moving
cylinders (``movers``). Each stands on the ground (down = 0) and reaches ``height_m`` up; ``inf`` is taller than any
flight. One source feeds the LiDAR, the collision checker and the pictures.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from companion.core.types import F64

MOVER_SPEED_SPREAD = 0.4  # a seeded mover goes at 60..100 % of its speed_max_m_s


@dataclass(frozen=True, slots=True)
class Mover:
    """A disc that goes to and fro between two points at constant speed: a pure function of time."""

    a_ned_m: tuple[float, float]
    b_ned_m: tuple[float, float]
    radius_m: float
    height_m: float
    speed_max_m_s: float
    speed_m_s: float  # never above speed_max_m_s
    phase: float  # where in its cycle at t = 0: [0, 1), 0 = at a, 1/2 = at b

    def position_ned_m(self, t_s: float) -> tuple[float, float]:
        """Centre (north, east) at ``t_s``."""
        (a_n, a_e), (b_n, b_e) = self.a_ned_m, self.b_ned_m
        length_m = math.hypot(b_n - a_n, b_e - a_e)
        cycle = (self.phase + t_s * self.speed_m_s / (2.0 * length_m)) % 1.0
        along = 1.0 - abs(2.0 * cycle - 1.0)
        return a_n + along * (b_n - a_n), a_e + along * (b_e - a_e)


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Surroundings of one mission; arrays are read-only."""

    name: str
    start_ned_m: F64  # (2,)
    goal_ned_m: F64  # (2,)
    bounds_m: tuple[float, float, float, float]  # north min, east min, north max, east max
    circles: F64  # (n, 4): north, east, radius, height [m]
    boxes: F64  # (b, 6): centre north, centre east [m], yaw [rad], half length, half width, height [m]
    movers: tuple[Mover, ...] = ()

    def __post_init__(self) -> None:
        for array in (self.start_ned_m, self.goal_ned_m, self.circles, self.boxes):
            array.flags.writeable = False

    def at(self, t_s: float) -> F64:
        """Circles (n + m, 4) with the movers placed where they are at ``t_s``, after the n that stand still."""
        if not self.movers:
            return self.circles
        placed = [(*m.position_ned_m(t_s), m.radius_m, m.height_m) for m in self.movers]
        return np.concatenate([self.circles, np.array(placed)])

    def seeded(self, seed: int) -> "World":
        """The same world with phase and speed of every mover drawn from ``seed``."""
        rng = np.random.default_rng(seed)
        draws = rng.uniform(size=(len(self.movers), 2))
        movers = tuple(
            dataclasses.replace(
                m, phase=float(d[0]), speed_m_s=m.speed_max_m_s * (1.0 - MOVER_SPEED_SPREAD * float(d[1]))
            )
            for m, d in zip(self.movers, draws, strict=True)
        )
        return dataclasses.replace(self, movers=movers)

    def inside(self, north_m: float, east_m: float) -> bool:
        """Within the bounds?"""
        n_min, e_min, n_max, e_max = self.bounds_m
        return n_min <= north_m <= n_max and e_min <= east_m <= e_max


def wall_box(
    from_ned_m: tuple[float, float], to_ned_m: tuple[float, float], thickness_m: float, height_m: float
) -> list[float]:
    """A straight wall as one row of ``boxes``."""
    north_m, east_m = to_ned_m[0] - from_ned_m[0], to_ned_m[1] - from_ned_m[1]
    return [
        (from_ned_m[0] + to_ned_m[0]) / 2,
        (from_ned_m[1] + to_ned_m[1]) / 2,
        math.atan2(east_m, north_m),
        math.hypot(north_m, east_m) / 2,
        thickness_m / 2,
        height_m,
    ]


def arc_boxes(
    centre_ned_m: tuple[float, float],
    radius_m: float,
    from_rad: float,
    to_rad: float,
    thickness_m: float,
    height_m: float,
    sagitta_m: float = 0.02,
) -> list[list[float]]:
    """A curved wall as rows of ``boxes``; ``radius_m`` is its middle line, bearings clockwise from north.

    Every box is tangent to the arc and reaches to where its outer face meets the next one's, so that the chain has no
    notch; the true arc is missed by at most ``sagitta_m``.
    """
    outer_m = radius_m + thickness_m / 2
    span_rad = to_rad - from_rad
    pieces = max(1, math.ceil(span_rad / (2.0 * math.acos(outer_m / (outer_m + sagitta_m)))))
    half_rad = span_rad / pieces / 2
    rows = []
    for i in range(pieces):
        bearing_rad = from_rad + (2 * i + 1) * half_rad
        rows.append(
            [
                centre_ned_m[0] + radius_m * math.cos(bearing_rad),
                centre_ned_m[1] + radius_m * math.sin(bearing_rad),
                bearing_rad + math.pi / 2,
                outer_m * math.tan(half_rad),
                thickness_m / 2,
                height_m,
            ]
        )
    return rows


def box_corners(boxes: F64) -> F64:
    """Corners (b, 4, 2) of rows of ``boxes``, in order around each."""
    cos, sin = np.cos(boxes[:, 2])[:, None], np.sin(boxes[:, 2])[:, None]
    along = boxes[:, 3:4] * np.array([1.0, 1.0, -1.0, -1.0])
    across = boxes[:, 4:5] * np.array([-1.0, 1.0, 1.0, -1.0])
    north = boxes[:, 0:1] + along * cos - across * sin
    east = boxes[:, 1:2] + along * sin + across * cos
    return np.stack([north, east], axis=-1)
