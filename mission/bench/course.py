"""What is one thing to be flown in a benchmark? A world with start and goal, and the rules of its suite. Values."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from companion.core.types import F64
from sitl.world import World

STIFF = {"MPC_XY_P": 1.5, "MPC_XY_VEL_P_ACC": 4.0}  # a velocity loop of 4 1/s, position loop to match


@dataclass(frozen=True, slots=True)
class Rules:
    """Under which rules a suite is flown; the same for every pilot."""

    speed_m_s: float  # cap of the pilot's cruise
    radius_m: float  # of the vehicle, as a disc
    time_limit_s: float  # vehicle time from the first tick in OFFBOARD
    goal_radius_m: float | None  # finished within this of the goal; None: finished beyond ``finish_north_m``
    finish_north_m: float | None = None
    altitude_m: float = 2.5
    range_m: float = 30.0  # of the LiDAR
    rate_hz: float = 25.0
    sigma_m: float = 0.01
    jitter_m: float = 0.05  # the start is drawn within this
    at_speed: bool = False  # starts at ``speed_m_s`` along north instead of hovering
    measure_from_m: float = 0.0  # mean speed counts from this far on
    params: dict[str, dict[str, Any]] = field(default_factory=dict)  # of the companion, as the suite declares them


@dataclass(frozen=True, slots=True)
class Course:
    """One world of a suite."""

    cell: str  # flights are counted per cell
    name: str  # of the world, as the table of flights has it
    world: World
    rules: Rules
    reference_m: float | None = None  # length of the reference path, where a score is made of it
    yaw_rad: float = 0.0  # nose at the start
    task_goal_ned_m: F64 | None = None  # where the pilot is sent; None: the world's goal

    @property
    def sent_to_ned_m(self) -> F64:
        """The goal (2,) that the pilot is given."""
        return self.world.goal_ned_m if self.task_goal_ned_m is None else self.task_goal_ned_m

    def finished(self, north_m: float, east_m: float) -> bool:
        """Is this place (world) where a flight ends well?"""
        if self.rules.goal_radius_m is None:
            return self.rules.finish_north_m is not None and north_m >= self.rules.finish_north_m
        goal = self.world.goal_ned_m
        return float(np.hypot(north_m - goal[0], east_m - goal[1])) <= self.rules.goal_radius_m


@dataclass(frozen=True, slots=True)
class Skipped:
    """A world that cannot be flown, and why."""

    name: str
    reason: str
