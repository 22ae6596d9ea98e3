"""Has the vehicle touched anything, and how near was it? Looks only as often as its speed demands; vehicle time."""

import math

from companion.core.types import F64
from sitl.collision import CollisionChecker
from sitl.neighbours import Neighbours
from sitl.vehicle import Truth
from sitl.world import World

SPEED_SLACK_M_S = 2.0  # assumed: more than the vehicle gains within one scan


class ContactWatch:
    """Clearance along one flight. Look at step 0, then at ``due_step``."""

    def __init__(
        self,
        world: World,
        radius_m: float,
        spawn_ned_m: F64,
        step_s: float,
        scan_steps: int,
        neighbours: Neighbours | None = None,
    ) -> None:
        self.contact = False  # ever
        self._collision = CollisionChecker(world, radius_m)
        self._neighbours = neighbours
        self._radius_m = radius_m
        self._mover_m_s = max((m.speed_m_s for m in world.movers), default=0.0)
        self._spawn_ned_m = spawn_ned_m
        self._step_s = step_s
        self._scan_steps = scan_steps
        self.due_step = 0  # when to look again
        self._smallest_m = math.inf

    def look(self, step: int, t_s: float, truth: Truth) -> None:
        """Measure, and work out until when nothing can be touched: clearance over the highest closing speed."""
        pos_world_ned_m = truth.pos_ned_m + self._spawn_ned_m
        clearance_m = self._collision.clearance(t_s, pos_world_ned_m)
        others_m_s = self._mover_m_s
        if self._neighbours is not None:
            clearance_m = min(clearance_m, self._neighbours.clearance_m(t_s, pos_world_ned_m, self._radius_m))
            others_m_s = max(others_m_s, self._neighbours.speed_max_m_s + SPEED_SLACK_M_S)
        self._smallest_m = min(self._smallest_m, clearance_m)
        self.contact = self.contact or not clearance_m > 0.0
        speed_m_s = math.hypot(*truth.vel_ned_m_s.tolist()) + SPEED_SLACK_M_S + others_m_s
        free_steps = clearance_m / speed_m_s / self._step_s
        to_scan = self._scan_steps - step % self._scan_steps
        if free_steps >= to_scan:
            self.due_step = step + to_scan
        else:
            self.due_step = step + (int(free_steps) if free_steps > 1.0 else 1)

    def take_smallest_m(self) -> float:
        """Smallest clearance since the last call."""
        smallest_m, self._smallest_m = self._smallest_m, math.inf
        return smallest_m
