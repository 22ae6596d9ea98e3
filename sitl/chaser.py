"""Where on its way should the vehicle be now? A point that runs to a target with limited speed and acceleration.

Local ned. Unlike a ramp it may be given a new target at any moment and goes on from the speed that it has; it is moved
on at every control tick, and memory is its position, velocity and yaw.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from companion.core.frames import wrap_rad, yaw_rad
from companion.core.types import F64, VehicleState
from sitl.demand import Demand, position_demand

ACC_M_S2: Final = 2.0  # assumed, as flight_tasks.RAMP_ACC_M_S2
BRAKE_M_S2: Final = 1.6  # planned braking; the rest is margin
APPROACH_1_S: Final = 2.0  # speed over distance near the target
YAW_RATE_RAD_S: Final = math.radians(60.0)  # MPC_YAWRAUTO_MAX
TILT_S: Final = 0.2  # assumed: how fast an acceleration comes and goes
STOPPED_M: Final = 1e-3
PAUSE_S: Final = 0.1  # when nobody asked for longer, the point has stood still


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a way is flown."""

    level_m_s: float
    up_m_s: float
    down_m_s: float
    passing_m_s: float = 0.0  # speed still allowed at the target


class Chaser:
    """The point; begins at the vehicle and its speed."""

    def __init__(self, state: VehicleState) -> None:
        self.pos_ned_m: F64 = state.pos_ned_m.copy()
        self.vel_ned_m_s: F64 = state.vel_ned_m_s.copy()
        self.acc_ned_m_s2: F64 = np.zeros(3)  # fed forward, smoothed: a vehicle has to tilt first
        self.yaw_rad = yaw_rad(state.q_ned_frd)
        self._t_s = state.t_s

    def run(self, t_s: float, target_ned_m: F64, pace: Pace, nose_rad: float) -> Demand:
        """Move on to ``t_s``; ``nose_rad`` NaN keeps the yaw."""
        dt_s, self._t_s = min(max(t_s - self._t_s, 0.0), PAUSE_S), t_s
        if dt_s > 0.0:
            self._move(dt_s, target_ned_m, pace)
            if math.isfinite(nose_rad):
                turn = wrap_rad(nose_rad - self.yaw_rad)
                limit = YAW_RATE_RAD_S * dt_s
                self.yaw_rad = wrap_rad(self.yaw_rad + min(max(turn, -limit), limit))
        return position_demand(self.pos_ned_m, self.yaw_rad, self.vel_ned_m_s, self.acc_ned_m_s2)

    def _move(self, dt_s: float, target_ned_m: F64, pace: Pace) -> None:
        way = target_ned_m - self.pos_ned_m
        length_m = float(np.linalg.norm(way))
        if length_m < STOPPED_M and pace.passing_m_s == 0.0:
            wanted = way / dt_s
        else:
            wanted = way * (speed_m_s(way, length_m, pace) / max(length_m, STOPPED_M))
        change = wanted - self.vel_ned_m_s
        size = float(np.linalg.norm(change))
        change = change * min(1.0, ACC_M_S2 * dt_s / max(size, 1e-9))
        self.vel_ned_m_s = self.vel_ned_m_s + change
        self.acc_ned_m_s2 = self.acc_ned_m_s2 + (change / dt_s - self.acc_ned_m_s2) * min(1.0, dt_s / TILT_S)
        self.pos_ned_m = self.pos_ned_m + self.vel_ned_m_s * dt_s


class Settle:
    """The flight task that goes on to the last place and stays there."""

    def __init__(self, chaser: Chaser, ned_m: F64, pace: Pace) -> None:
        self._chaser = chaser
        self._ned_m = ned_m
        self._pace = replace(pace, passing_m_s=0.0)

    def demand(self, state: VehicleState) -> Demand:
        """On the way to the place, or there."""
        return self._chaser.run(state.t_s, self._ned_m, self._pace, math.nan)

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False


def speed_m_s(way: F64, length_m: float, pace: Pace) -> float:
    """The speed towards a target: what braking allows, and no axis faster than its limit."""
    level_m, down_m = math.hypot(way[0], way[1]), float(way[2])
    speed = max(braking_speed_m_s(length_m), pace.passing_m_s)
    if level_m > 0.0:
        speed = min(speed, pace.level_m_s * length_m / level_m)
    if down_m != 0.0:
        limit_m_s = pace.down_m_s if down_m > 0.0 else pace.up_m_s
        speed = min(speed, limit_m_s * length_m / abs(down_m))
    return speed


def braking_speed_m_s(distance_m: float) -> float:
    """PX4's square root with a straight end: linear near the target, constant braking before."""
    linear_m = BRAKE_M_S2 / APPROACH_1_S**2
    if distance_m <= linear_m:
        return APPROACH_1_S * distance_m
    return math.sqrt(2.0 * BRAKE_M_S2 * (distance_m - linear_m / 2))


def corner_speed_m_s(before: F64, after: F64, radius_m: float) -> float:
    """How fast a corner may be cut that is rounded within ``radius_m`` (PX4's waypoint speed)."""
    lengths = float(np.linalg.norm(before)) * float(np.linalg.norm(after))
    if lengths == 0.0:
        return 0.0
    turn_rad = math.acos(min(1.0, max(-1.0, float(before @ after) / lengths)))
    return math.sqrt(ACC_M_S2 * radius_m / max(math.tan(turn_rad / 2), 1e-3))
