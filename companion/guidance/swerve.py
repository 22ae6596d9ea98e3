"""Where going on would touch something before the vehicle stands: to which side does it pass instead? Pure; local ned.

To brake from v takes v tau + v^2 / 2 a, to step aside by a hull's width hardly more than the lag: a vehicle too fast to
stop may still pass. Once begun a swerve keeps its side and its direction, at full acceleration, until the line ahead is
free: two sides that take turns would hit what lies between them.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core import geometry
from companion.core.frames import wrap_rad
from companion.core.types import F64, Setpoint, VehicleState
from companion.guidance.limits import LimitsParams, stopping_distance

LEAST_M_S = 3.0  # slower than this, braking is quicker than to step aside by a trunk's radius and the hull's
TURN_MAX_RAD = math.radians(60.0)  # farther round than this, brake
TURNS_RAD = np.radians([10.0, 20.0, 30.0, 40.0, 50.0])
ARC_PIECES = 5
ROOM_M = -0.1  # clearance of a track that is begun: braking would touch anyway, and a scan makes things wider
IN_HAND_S = 0.07  # a stop is shorter than it is reckoned with by so much time at speed
OFF_PLAN_M = 0.15  # a side away from the planned way must have so much more clearance
PUSH_S = 0.3  # the velocity asked for runs ahead of the vehicle's by so much of the acceleration
TURN_GAP_S = 0.15  # two scans at 15 Hz: a swerve that paused for longer is over
AFTER_S = 0.5  # off a path, how long the vehicle goes straight on after a swerve


@dataclass(frozen=True, slots=True)
class Swerve:
    """A swerve that has begun."""

    course_rad: float  # before it began
    side: float  # 1 right, -1 left
    t_s: float  # when it last turned


@dataclass(frozen=True, slots=True)
class Motion:
    """What the vehicle does now, and how it is reckoned to turn."""

    speed_m_s: float
    course_rad: float
    acc_m_s2: float
    stop_m: float  # from its speed to standstill


def turn_aside(
    before: Swerve | None,
    state: VehicleState,
    points_ne_m: F64,
    radius_m: float,
    planned_rad: float | None,
    params: LimitsParams,
) -> Swerve | None:
    """To the side with more room, the same as in the tick before; None: brake.

    Braking goes first where it ends in time.

    Args:
        before: of the tick before; what turned longer ago is forgotten.
        state: where and how fast the vehicle is.
        points_ne_m: (n, 2) what may not be touched.
        radius_m: of the hull.
        planned_rad: course of the way that would be flown; None: it has none.
        params: ``swerve_m_s2`` is 0 where swerving is off.
    """
    speed = math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
    if not (params.swerve_m_s2 > 0.0 and speed > LEAST_M_S and np.isfinite(state.pos_ned_m[:2]).all()):
        return None
    course = math.atan2(state.vel_ned_m_s[1], state.vel_ned_m_s[0])
    if before is not None and not (state.t_s - before.t_s <= TURN_GAP_S and turned_rad(before, course) < TURN_MAX_RAD):
        before = None
    here, stop_m = state.pos_ned_m[:2], stopping_distance(speed, params.decel_m_s2, params.stop_tau_s)
    motion = Motion(speed, course, params.swerve_m_s2, stop_m)
    longest_m = geometry.length(track_of(here, motion, float(TURNS_RAD[-1])))
    near = geometry.points_near(here[None], points_ne_m, longest_m + radius_m)
    straight = here + (stop_m - IN_HAND_S * speed) * np.array([[0.0, 0.0], [math.cos(course), math.sin(course)]])
    if geometry.nearest_distance(straight, near) >= radius_m:
        return None
    room_m = {}
    for side in (1.0, -1.0) if before is None else (before.side,):
        tracks = (track_of(here, motion, side * float(turn)) for turn in TURNS_RAD)
        room_m[side] = max(geometry.nearest_distance(track, near) for track in tracks) - radius_m
    planned = 0.0 if planned_rad is None else wrap_rad(planned_rad - course)
    best = max(room_m, key=lambda side: room_m[side] + (OFF_PLAN_M if side * planned > 0.0 else 0.0))
    if before is None and not room_m[best] > ROOM_M:
        return None
    return Swerve(course if before is None else before.course_rad, best, state.t_s)


def past(swerve: Swerve, state: VehicleState) -> bool:
    """Has it turned a moment ago? Then the vehicle goes straight on and does not turn back yet."""
    return state.t_s - swerve.t_s <= AFTER_S


def turned_rad(swerve: Swerve, course_rad: float) -> float:
    """How far the vehicle has turned to that side since it began."""
    return swerve.side * wrap_rad(course_rad - swerve.course_rad)


def track_of(pos_ne_m: F64, motion: Motion, turn_rad: float) -> F64:
    """(k, 2) what the vehicle flies when it turns by that much: an arc, and straight on to standstill."""
    arc_m = abs(turn_rad) * motion.speed_m_s * motion.speed_m_s / motion.acc_m_s2
    ways = np.array([*[arc_m / ARC_PIECES] * ARC_PIECES, motion.stop_m])
    courses = motion.course_rad + turn_rad * np.array([*(np.arange(ARC_PIECES) + 0.5) / ARC_PIECES, 1.0])
    moves = ways[:, None] * np.stack([np.cos(courses), np.sin(courses)], axis=1)
    track: F64 = np.concatenate([pos_ne_m[None], pos_ne_m + np.cumsum(moves, axis=0)])
    return track


def setpoint(
    swerve: Swerve, state: VehicleState, turning: bool, down_m: float, yaw_rad: float, params: LimitsParams
) -> Setpoint:
    """All sideways; ``turning`` False: straight on. The place asked for is the vehicle's own: it pulls nowhere."""
    aside = swerve.course_rad + swerve.side * math.pi / 2.0
    acc = np.array([math.cos(aside), math.sin(aside), 0.0]) * (params.swerve_m_s2 if turning else 0.0)
    vel = np.array([*state.vel_ned_m_s[:2], 0.0]) + PUSH_S * acc
    return Setpoint(state.t_s, np.array([*state.pos_ned_m[:2], down_m]), vel, acc, yaw_rad)
