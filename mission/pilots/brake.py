"""Straight at the goal and brake: what is PX4's collision prevention worth? Pure; local NED, bearings frd.

A pilot who holds the stick towards the goal, in PX4's position mode with collision prevention on. Written anew after
PX4 1.15: ``CollisionPrevention.cpp`` (steer by at most CP_GUIDE_ANG, scale what pushes towards the nearest obstacle,
brake by the speed from which it could stop), ``StickAccelerationXY.cpp`` (stick to acceleration, drag, velocity by
integration) and ``TrajMath.hpp`` (speed from distance). It sees the present scan only, as PX4 does.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.params import param
from companion.core.types import F64
from companion.perception.polar import BEARING_RAD, BEARINGS
from mission.pilots.cockpit import Recipe, View, Wish, shortened

SECTOR_DEG = 360.0 / BEARINGS
SIDE_BINS = 1  # to either side, over which the guidance averages
GUIDE_COST = 0.5  # of a metre of CP_DIST per sector of deviation (50 in PX4's centimetres)
FAR_M = 12.0  # an empty sector reports the sensor's range
DT_MAX_S = 0.2  # a longer gap between ticks moves the velocity no further


@dataclass(frozen=True, slots=True)
class BrakeParams:
    """PX4's parameters, by PX4's names; CP_DIST was tuned."""

    cp_dist_m: float = param(0.6, "CP_DIST", "Distance to keep from the centre to all obstacles", "m", 0.1, 15.0)
    cp_delay_s: float = param(0.4, "CP_DELAY", "Sensor and tracking delay", "s", 0.0, 1.0)
    cp_guide_deg: float = param(30.0, "CP_GUIDE_ANG", "Largest steering off the stick's direction", "deg", 0.0, 90.0)
    acc_hor_m_s2: float = param(3.0, "MPC_ACC_HOR", "Acceleration of a full stick", "m/s2", 0.1, 15.0)
    jerk_m_s3: float = param(8.0, "MPC_JERK_MAX", "Jerk of a stop", "m/s3", 0.5, 500.0)
    pos_p_1_s: float = param(0.95, "MPC_XY_P", "Position gain", "1/s", 0.1, 2.0)
    vel_p_1_s: float = param(1.8, "MPC_XY_VEL_P_ACC", "Velocity gain", "1/s", 1.2, 5.0)


class Brake(Recipe):
    """Pilot 'brake'."""

    name = "brake"
    source = "PX4 CollisionPrevention.cpp, StickAccelerationXY.cpp (BSD-3), read, not copied"

    def __init__(self, params: BrakeParams | None = None) -> None:
        self._params = params or BrakeParams()

    def steer(self, view: View, velocity_sp: F64 | None) -> tuple[F64, Wish]:
        """The next velocity setpoint, which is also what is remembered."""
        before = view.vel_ne_m_s if velocity_sp is None else velocity_sp
        share = view.approach_m_s / view.task.cruise_m_s
        stick = share * np.array([math.cos(view.goal_course_rad), math.sin(view.goal_course_rad)])
        full_m_s2 = 2.0 * self._params.acc_hor_m_s2  # drag takes half of it on the way up to speed
        ranges = Ranges.of(view)
        pushed = constrained(full_m_s2 * stick, before, ranges, view.task.cruise_m_s, self._params)
        drag = full_m_s2 / view.task.cruise_m_s * _firmer_when_slow(before)
        after = before + (pushed - drag) * min(max(view.dt_s, 0.0), DT_MAX_S)
        after = shortened(after, view.task.cruise_m_s)
        return after, Wish("straight", after, course_rad=view.goal_course_rad)


@dataclass(frozen=True, slots=True)
class Ranges:
    """The present scan in local NED; ``range_m`` is nan where nothing is known."""

    course_rad: F64  # (72,)
    range_m: F64  # (72,)

    @staticmethod
    def of(view: View) -> "Ranges":
        """What perception made of the scan."""
        return Ranges(BEARING_RAD + yaw_rad(view.state.q_ned_frd), view.percept.bearing_range_m)

    def sector(self, course_rad: float) -> int:
        """The one nearest to a course."""
        return round((course_rad - float(self.course_rad[0])) / math.radians(SECTOR_DEG)) % BEARINGS

    def direction(self, sector: int) -> F64:
        """(2,) unit."""
        return np.array([math.cos(self.course_rad[sector]), math.sin(self.course_rad[sector])])


def constrained(acc_m_s2: F64, vel_m_s: F64, ranges: Ranges, cruise_m_s: float, params: BrakeParams) -> F64:
    """The acceleration (2,) that collision prevention lets through; none where nothing is seen."""
    size = math.hypot(*acc_m_s2)
    if not size > 1e-3 or np.isnan(ranges.range_m).all():
        return np.zeros(2)
    wanted = ranges.sector(math.atan2(acc_m_s2[1], acc_m_s2[0]))
    sector = _guided(wanted, ranges, params)
    course = acc_m_s2 / size if sector == wanted else ranges.direction(sector)
    through = np.zeros(2)
    if not math.isnan(ranges.range_m[sector]):
        through = size * _scaled(course, ranges, cruise_m_s, params)
    return through + _braking(vel_m_s, ranges, params)


def stop_speed(distance_m: float, params: BrakeParams) -> float:
    """Speed from which a jerk-limited stop fits into the distance."""
    lag = 4.0 * params.acc_hor_m_s2**2 / params.jerk_m_s3
    return 0.5 * (-lag + math.sqrt(lag * lag + 8.0 * params.acc_hor_m_s2 * max(distance_m, 0.0)))


def _firmer_when_slow(vel_m_s: F64) -> F64:
    """The velocity that drag is taken from: below 1 m/s as large as its root."""
    speed = math.hypot(*vel_m_s)
    return vel_m_s / math.sqrt(speed) if 0.0 < speed < 1.0 else vel_m_s


def _guided(wanted: int, ranges: Ranges, params: BrakeParams) -> int:
    """The sector near the wanted one that sees farther, at a price for each sector of deviation."""
    bins = math.floor(params.cp_guide_deg / SECTOR_DEG)
    seen_m = np.minimum(ranges.range_m, FAR_M)
    filled_m = np.where(np.isnan(seen_m), params.cp_dist_m, seen_m)
    best, best_cost = wanted, math.inf
    for off in sorted(range(-bins, bins + 1), key=abs):
        sector = (wanted + off) % BEARINGS
        around = filled_m.take(range(sector - SIDE_BINS, sector + SIDE_BINS + 1), mode="wrap")
        cost = GUIDE_COST * params.cp_dist_m * abs(off) - float(around.mean()) - float(filled_m[sector])
        if not math.isnan(seen_m[sector]) and cost < best_cost - 1e-9:
            best, best_cost = sector, cost
    return best


def _scaled(course: F64, ranges: Ranges, cruise_m_s: float, params: BrakeParams) -> F64:
    """Share (2,) of the push that is left, taken apart into towards the nearest obstacle and along it."""
    nearest = int(np.argmin(np.where(np.isnan(ranges.range_m), np.inf, ranges.range_m)))
    towards = ranges.direction(nearest)
    along = course - towards * float(course @ towards)
    if not float(course @ towards) > 0.0:
        return course
    side_m = float(ranges.range_m[ranges.sector(math.atan2(along[1], along[0]))])
    normal = towards * float(course @ towards)
    return along * _scale(side_m, cruise_m_s, params) + normal * _scale(
        float(ranges.range_m[nearest]), cruise_m_s, params
    )


def _scale(distance_m: float, cruise_m_s: float, params: BrakeParams) -> float:
    room_m = distance_m - params.cp_dist_m
    if not room_m > 0.0:
        return 0.0 if math.isnan(room_m) else room_m
    return min((room_m / max(params.cp_dist_m, cruise_m_s / params.pos_p_1_s)) ** 2, 1.0)


def _braking(vel_m_s: F64, ranges: Ranges, params: BrakeParams) -> F64:
    """Acceleration (2,) away from the sector whose stopping speed is exceeded the most; none where none is.

    PX4 adds it where it is positive too, a push into the nearest sector: left out.
    """
    directions = np.stack([np.cos(ranges.course_rad), np.sin(ranges.course_rad)], axis=1)
    closing = np.maximum(directions @ vel_m_s, 0.0)
    best, least = 0, math.inf
    for sector in np.flatnonzero(np.isfinite(ranges.range_m)).tolist():
        room_m = ranges.range_m[sector] - params.cp_dist_m - closing[sector] * params.cp_delay_s
        asked = params.vel_p_1_s * (stop_speed(room_m, params) - closing[sector])
        if asked < least:
            best, least = sector, asked
    return np.zeros(2) if least == math.inf else min(least, 0.0) * directions[best]
