"""How is a checked path flown from here? Clamp, limits, follower, yaw: shared by Travel and RL; pure; local NED."""

import math
from dataclasses import dataclass

import numpy as np

from companion.core import geometry
from companion.core.frames import wrap_rad
from companion.core.gridmap import GridMap, seen
from companion.core.types import F64, Setpoint, VehicleState
from companion.guidance import follower, limits
from companion.navigator.params import Params
from companion.perception.perceive import Percept

HORIZON_M = 8.0  # the clamp looks this far: more than any speed of the vehicle class needs at a cap of 5 m/s
SEEN_STEP_M = 0.4  # two cells
YAW_AHEAD_M = 1.5  # the nose points at the path this far ahead
YAW_STEP_MAX_S = 0.2  # a longer gap between ticks turns the nose no further
SLOW_PATH_M = 0.3  # a path shorter than this gives no course


@dataclass(frozen=True, slots=True)
class Route:
    """What to fly along, and how."""

    vertices_ne_m: F64  # (k, 2)
    s_m: float  # progress so far
    cruise_m_s: float
    down_m: float
    margin_m: float  # of the corridor, beyond the radius
    course_rad: float | None = None  # course correction of the line law; None: along the path


@dataclass(frozen=True, slots=True)
class Tracked:
    """The setpoint and what led to it."""

    setpoint: Setpoint
    s_m: float
    lateral_m: float
    speed_m_s: float
    free_m: float


def track(route: Route, state: VehicleState, percept: Percept, yaw_rad: float, params: Params) -> Tracked:
    """One tick along ``route``; ``yaw_rad`` is passed through."""
    at = follower.progress(route.vertices_ne_m, state.pos_ned_m, route.s_m, params.follower)
    free_m = free_length(route.vertices_ne_m, at.s_m, percept, params.vehicle.radius_m + route.margin_m)
    ahead = limits.Ahead(free_m, _clearance(route.vertices_ne_m, at.s_m, percept, params), percept.s_fuzzy)
    speed = limits.path_speed(route.vertices_ne_m, at.s_m, route.cruise_m_s, ahead, params.limits)
    speed = limits.limit_rise(speed, state.vel_ned_m_s, geometry.tangent_at(route.vertices_ne_m, at.s_m), params.limits)
    target = follower.Target(speed, route.down_m, yaw_rad, route.course_rad)
    followed = follower.follow(route.vertices_ne_m, state, at, target, params.follower)
    return Tracked(followed.setpoint, followed.s_m, followed.lateral_m, speed, free_m)


def free_length(vertices_ne_m: F64, s_m: float, percept: Percept, radius_m: float) -> float:
    """Length of the swept corridor ahead that is free and has been seen."""
    ahead = geometry.part(vertices_ne_m, s_m, s_m + HORIZON_M)
    return min(geometry.swept_free_length(ahead, percept.points_ne_m, radius_m), _seen_length(ahead, percept.grid))


def course_along(vertices_ne_m: F64, s_m: float) -> float | None:
    """Course of the path a little ahead, or None where it ends."""
    here, there = geometry.point_at(vertices_ne_m, s_m), geometry.point_at(vertices_ne_m, s_m + YAW_AHEAD_M)
    dn, de = float(there[0] - here[0]), float(there[1] - here[1])
    return math.atan2(de, dn) if math.hypot(dn, de) > SLOW_PATH_M else None


def turned(yaw_sp_rad: float, wanted_rad: float | None, dt_s: float, rate_rad_s: float) -> float:
    """The yaw setpoint, turned towards the wanted course at a bounded rate."""
    if wanted_rad is None:
        return yaw_sp_rad
    step = rate_rad_s * min(max(dt_s, 0.0), YAW_STEP_MAX_S)
    return wrap_rad(yaw_sp_rad + min(max(wrap_rad(wanted_rad - yaw_sp_rad), -step), step))


def _seen_length(ahead_ne_m: F64, grid: GridMap) -> float:
    """How far along the path every place has been seen; inf where all of it has."""
    places = geometry.resample(ahead_ne_m, SEEN_STEP_M)
    known = seen(grid, places)
    if known.all():
        return math.inf
    steps = np.hypot(*np.diff(places, axis=0).T)
    first = int(np.argmin(known))
    return float(steps[: max(first - 1, 0)].sum())


def _clearance(vertices_ne_m: F64, s_m: float, percept: Percept, params: Params) -> float:
    """Least distance from the hull to anything beside the stretch about to be flown; inf if nothing is near."""
    radius = params.vehicle.radius_m
    stretch = geometry.part(vertices_ne_m, s_m, s_m + params.limits.side_full_m + radius)
    return geometry.nearest_distance(stretch, percept.static_ne_m, radius + params.limits.side_full_m) - radius
