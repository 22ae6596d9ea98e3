"""Where are the other vehicles of this world now? What they last said of themselves, carried on; pure; world ned.

To the LiDAR a vehicle at about the same height is what every mover is in a 2.5-D world, an upright cylinder taller than
any tilt: a sweep that leans by ten degrees would pass over or under a hull of 16 cm at five metres. Contact and
clearance are between the hulls as they are.
"""

import math
from typing import Final

import numpy as np

from companion.core.types import F64
from sitl.vehicle import Truth

HALF_HEIGHT_M: Final = 0.08  # of the hull, as ``CollisionChecker`` has it
SEEN_WITHIN_M: Final = 1.5  # of height, up or down: further off a sweep passes over or under
ROW: Final = 6  # position and velocity, world ned


class Neighbours:
    """The other vehicles. Straight on from what was heard: half a centimetre off after 40 ms of braking at 6 m/s2."""

    def __init__(self, radius_m: float) -> None:
        """``radius_m``: of each of them."""
        self._radius_m = radius_m
        self._rows: F64 = np.zeros((0, ROW))
        self._heard_s = 0.0

    def hear(self, world_s: float, rows: F64) -> None:
        """Where they are, (n, 6): north, east, down [m] and their rates [m/s] at ``world_s``."""
        self._heard_s, self._rows = world_s, rows

    @property
    def speed_max_m_s(self) -> float:
        """Of the fastest."""
        return float(np.linalg.norm(self._rows[:, 3:], axis=1).max()) if len(self._rows) else 0.0

    def positions_ned_m(self, world_s: float) -> F64:
        """(n, 3) at ``world_s``."""
        return self._rows[:, :3] + (world_s - self._heard_s) * self._rows[:, 3:]

    def circles(self, world_s: float, down_m: float) -> F64:
        """What a LiDAR at the height ``down_m`` sees of them: (k, 4) as a world's circles."""
        there = self.positions_ned_m(world_s)
        seen = there[np.abs(there[:, 2] - down_m) < SEEN_WITHIN_M]
        return np.column_stack([seen[:, :2], np.full(len(seen), self._radius_m), np.full(len(seen), math.inf)])

    def clearance_m(self, world_s: float, pos_ned_m: F64, radius_m: float) -> float:
        """From our hull at ``pos_ned_m`` (3,) to the nearest of theirs, surface to surface; inf without any."""
        nearest_m = math.inf
        for north_m, east_m, down_m in (self.positions_ned_m(world_s) - pos_ned_m).tolist():
            beside_m = math.hypot(north_m, east_m) - radius_m - self._radius_m
            above_m = abs(down_m) - 2.0 * HALF_HEIGHT_M
            nearest_m = min(nearest_m, math.hypot(max(beside_m, 0.0), above_m) if above_m > 0.0 else beside_m)
        return nearest_m


def row_of(truth: Truth, spawn_ned_m: F64) -> F64:
    """What a vehicle says of itself, (6,)."""
    return np.concatenate([truth.pos_ned_m + spawn_ned_m, truth.vel_ned_m_s])
