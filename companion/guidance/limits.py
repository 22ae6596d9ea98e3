"""How fast may the vehicle follow its path, when must it stop at once, and where does it then stand?

Pure; plane geometry in (north, east), local ned. Every limit is written so that NaN means the slowest answer. The speed
that stops in time and the two ways of holding are measured figures of a vehicle with PX4's gains (latency and tilt lag
together ``tau``, deceleration ``decel``).
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from companion.core import geometry
from companion.core.params import param
from companion.core.types import F64, Setpoint, VehicleState

CORNER_CUT_LEAST_M = 0.03  # a corner is never taken more exactly than this
STANDING_M_S = 0.15  # below this speed there is nothing to stop


@dataclass(frozen=True, slots=True)
class LimitsParams:
    """Bounds on motion along a path."""

    decel_m_s2: float = param(6.0, "LIM_DECEL", "deceleration of a stop at once", "m/s2", 0.5, 10.0)
    tau_s: float = param(
        0.45, "LIM_TAU", "scan age, link, tick and tilt lag together, before a stop bites", "s", 0.0, 2.0
    )
    brake_m_s2: float = param(2.5, "LIM_BRAKE", "deceleration planned towards corners and the end", "m/s2", 0.2, 6.0)
    rise_m_s2: float = param(2.75, "LIM_RISE", "acceleration asked for along the path", "m/s2", 0.2, 6.0)
    response_1_s: float = param(
        4.0, "LIM_RESPONSE", "gain of the velocity loop, feed-forward included", "1/s", 0.5, 10.0
    )
    lateral_m_s2: float = param(2.0, "LIM_LATERAL", "sideways acceleration in a turn", "m/s2", 0.2, 6.0)
    corner_cut_m: float = param(0.12, "LIM_CORNER_CUT", "how far a corner may be rounded off", "m", 0.02, 1.0)
    corner_share: float = param(0.4, "LIM_CORNER_SHARE", "share of the clearance a corner may be cut by", "", 0.0, 1.0)
    corner_min_m_s: float = param(0.4, "LIM_CORNER_MIN", "speed through the sharpest corner", "m/s", 0.1, 2.0)
    end_gain_1_s: float = param(1.2, "LIM_END_GAIN", "speed per metre left before a standstill", "1/s", 0.2, 3.0)
    lag_s: float = param(0.2, "LIM_LAG", "how late the vehicle follows a falling speed", "s", 0.0, 1.0)
    side_full_m: float = param(0.8, "LIM_SIDE_FULL", "clearance beside the hull that costs no speed", "m", 0.05, 5.0)
    side_min_m_s: float = param(0.6, "LIM_SIDE_MIN", "speed with no clearance beside the hull", "m/s", 0.1, 5.0)
    fuzzy_full: float = param(0.5, "LIM_FUZZY_FULL", "safety score that costs no speed", "", 0.01, 1.0)
    fuzzy_share: float = param(0.6, "LIM_FUZZY_SHARE", "share of the speed left at safety score 0", "", 0.1, 1.0)
    stop_tau_s: float = param(
        0.3, "LIM_STOP_TAU", "as tau, measured, for the stop rule: the last moment", "s", 0.0, 2.0
    )
    stop_margin_m: float = param(0.06, "LIM_STOP_MARGIN", "widening of the hull for the stop rule", "m", 0.0, 0.5)
    hold_from_m_s: float = param(3.0, "LIM_HOLD_FROM", "from here up hold at once, below ramp down", "m/s", 0.0, 20.0)
    clamp: bool = param(True, "LIM_CLAMP", "speed is bounded by what stops within the free length ahead")
    swerve_m_s2: float = param(
        0.0,
        "LIM_SWERVE",
        "sideways acceleration with which what a stop is due for is passed (0: stop)",
        "m/s2",
        0.0,
        7.0,
    )
    ramp_m_s2: float = param(4.0, "LIM_RAMP", "deceleration of the ramp into a hold", "m/s2", 0.5, 6.0)
    hold_gain_1_s: float = param(
        2.2, "LIM_HOLD_GAIN", "acceleration asked per velocity that the ramp does not have", "1/s", 0.0, 2.5
    )


@dataclass(frozen=True, slots=True)
class Ahead:
    """What is known of the corridor about to be flown."""

    free_length_m: float  # from the vehicle on, for the hull plus margin; ends where unseen space begins
    clearance_m: float  # least distance from the hull to anything beside that corridor; inf if nothing
    s_fuzzy: float  # safety score in [0, 1]
    ends_here: bool = True  # False: the path goes on beyond its last vertex, do not slow down for it


@dataclass(frozen=True, slots=True)
class HoldMemory:
    """Where, when and how fast the vehicle was when a hold was asked for."""

    t_s: float
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    yaw_rad: float


def stopping_speed(d_free_m: float, decel_m_s2: float = 6.0, tau_s: float = 0.45) -> float:
    """Largest speed that still stops within d_free_m; 0 for NaN and for nothing left."""
    if not d_free_m > 0.0:
        return 0.0
    lag = decel_m_s2 * tau_s
    return math.sqrt(lag * lag + 2.0 * decel_m_s2 * d_free_m) - lag


def stopping_distance(speed_m_s: float, decel_m_s2: float = 6.0, tau_s: float = 0.45) -> float:
    """Metres until standstill, the inverse of ``stopping_speed``."""
    speed = max(speed_m_s, 0.0)
    return speed * tau_s + speed * speed / (2.0 * decel_m_s2)


def path_speed(path_ned_m: F64, s_m: float, cruise_m_s: float, ahead: Ahead, params: LimitsParams) -> float:
    """Speed along the path at arc length s_m: the least of cruise, clamp, turns ahead, end, and side clearance."""
    speed = min(
        _known(cruise_m_s),
        corridor_speed(ahead.free_length_m, params),
        turn_speed(path_ned_m, s_m, ahead.clearance_m, params),
        side_speed(ahead, cruise_m_s, params),
    )
    if ahead.ends_here:
        speed = min(speed, end_speed(geometry.length(path_ned_m) - s_m, params))
    return max(speed, 0.0)


def corridor_speed(d_free_m: float, params: LimitsParams) -> float:
    """The clamp: stops at once within the free length, and also by gentle braking that the vehicle can track.

    The first alone, followed along as the free length shrinks, overruns by a vehicle's lag (0.2 m measured).
    """
    if not params.clamp:
        return math.inf
    return min(stopping_speed(d_free_m, params.decel_m_s2, params.tau_s), end_speed(d_free_m, params))


def limit_rise(speed_m_s: float, vel_ned_m_s: F64, tangent_ned: F64, params: LimitsParams) -> float:
    """The speed, no more above the measured speed along the path than asks for ``rise_m_s2`` of the velocity loop."""
    along = float(vel_ned_m_s[0]) * float(tangent_ned[0]) + float(vel_ned_m_s[1]) * float(tangent_ned[1])
    ceiling = max(_known(along), 0.0) + params.rise_m_s2 / params.response_1_s
    return min(_known(speed_m_s), ceiling)


def turn_speed(path_ned_m: F64, s_m: float, clearance_m: float, params: LimitsParams) -> float:
    """Speed now that lets every corner ahead be taken at its own speed, braking gently; inf on a straight line."""
    pieces = geometry.segments(path_ned_m)
    room_to_cut = params.corner_share * clearance_m if clearance_m > 0.0 else 0.0
    cut = min(params.corner_cut_m, max(room_to_cut, CORNER_CUT_LEAST_M))
    allowed = math.inf
    for before, after in itertools.pairwise(pieces):
        if after.s_m < s_m:
            continue
        radius, onset = _corner(before, after, cut)
        corner = max(math.sqrt(params.lateral_m_s2 * radius), params.corner_min_m_s)
        room = max(after.s_m - onset - s_m, 0.0)
        allowed = min(allowed, math.sqrt(corner * corner + 2.0 * params.brake_m_s2 * room))
    return allowed


def end_speed(left_m: float, params: LimitsParams) -> float:
    """Speed with left_m to a standstill: planned braking, then proportional; read where the vehicle will react."""
    if not left_m > 0.0:
        return 0.0
    brake, gain, lag = params.brake_m_s2, params.end_gain_1_s, params.lag_s
    knee_m_s = brake / gain  # both laws meet here with one slope
    tail_m = knee_m_s / gain
    if left_m <= tail_m + knee_m_s * lag:
        return left_m * gain / (1.0 + gain * lag)
    return stopping_speed(left_m - tail_m / 2.0, brake, lag)


def side_speed(ahead: Ahead, cruise_m_s: float, params: LimitsParams) -> float:
    """Gentle limit by what is beside the corridor (clearance) and around the vehicle (safety score)."""
    beside = min(max(ahead.clearance_m / params.side_full_m, 0.0), 1.0) if ahead.clearance_m > 0.0 else 0.0
    around = min(max(ahead.s_fuzzy / params.fuzzy_full, 0.0), 1.0) if ahead.s_fuzzy > 0.0 else 0.0
    cruise = _known(cruise_m_s)
    slowest = min(params.side_min_m_s, cruise)
    share = params.fuzzy_share + (1.0 - params.fuzzy_share) * around
    return max(slowest, share * (slowest + (cruise - slowest) * beside))


def velocity_stop_needed(
    pos_ned_m: F64, vel_ned_m_s: F64, points_ned_m: F64, radius_m: float, params: LimitsParams
) -> bool:
    """Would the hull, going on as it moves now, touch a point before it could stop? True for a NaN state.

    The tube is never wider than the present clearance, else the vehicle would freeze beside a tree.
    """
    (north, east), (north_m, east_m) = vel_ned_m_s[:2].tolist(), pos_ned_m[:2].tolist()
    speed = math.hypot(north, east)
    if not (math.isfinite(speed) and math.isfinite(north_m) and math.isfinite(east_m)):
        return True
    if speed < STANDING_M_S or len(points_ned_m) == 0:
        return False
    reach = stopping_distance(speed, params.decel_m_s2, params.stop_tau_s)
    share = reach / speed
    straight = np.array([[north_m, east_m], [north_m + north * share, east_m + east * share]])
    wide = radius_m + params.stop_margin_m
    near = geometry.points_near(straight, points_ned_m, wide)
    if len(near) == 0:
        return False
    now = geometry.nearest_distance(straight[:1], near)
    tube = max(min(wide, now - geometry.NEARER_M), 0.0)
    return geometry.swept_free_length(straight, near, tube) < reach - 1e-9


def hold(
    state: VehicleState, memory: HoldMemory | None, yaw_rad: float, params: LimitsParams
) -> tuple[HoldMemory, Setpoint]:
    """Stop and stand. Pass the memory back each tick; None asks anew.

    From ``hold_from_m_s`` up a position hold at the place of the request is the shortest stop; below it, a ramp of
    position, velocity and acceleration is. What the vehicle still gains after the request, and what wind adds, the
    ramp does not know: that is braked by its own acceleration, or a stop from 0.3 m/s took 0.28 m beside a trunk.
    """
    kept = memory or HoldMemory(state.t_s, state.pos_ned_m, state.vel_ned_m_s, yaw_rad)
    speed = math.hypot(float(kept.vel_ned_m_s[0]), float(kept.vel_ned_m_s[1]))
    pos, vel, acc = np.array(kept.pos_ned_m, dtype=np.float64), np.zeros(3), np.zeros(3)
    if 0.0 < speed < params.hold_from_m_s:
        course = kept.vel_ned_m_s[:2] / speed
        whole = speed / params.ramp_m_s2
        elapsed = min(max(state.t_s - kept.t_s, 0.0), whole)
        pos[:2] += course * (speed * elapsed - params.ramp_m_s2 * elapsed * elapsed / 2.0)
        if elapsed < whole:
            vel[:2] = course * (speed - params.ramp_m_s2 * elapsed)
            acc[:2] = course * -params.ramp_m_s2
        push = acc[:2] + params.hold_gain_1_s * (vel[:2] - state.vel_ned_m_s[:2])
        acc[:2] = geometry.shortened(float(push[0]), float(push[1]), params.decel_m_s2)
    return kept, Setpoint(state.t_s, pos, vel, acc, kept.yaw_rad)


def _corner(before: geometry.Segment, after: geometry.Segment, cut_m: float) -> tuple[float, float]:
    """Radius of the arc that rounds a corner, and how far before the corner it begins.

    Cutting it by ``cut_m`` at most, and using at most half of each adjoining piece.
    """
    cosine = before.dir_north * after.dir_north + before.dir_east * after.dir_east
    half_angle = math.acos(min(max(cosine, -1.0), 1.0)) / 2.0
    half_piece = min(before.length_m, after.length_m) / 2.0
    if half_angle < 1e-3:
        return math.inf, 0.0
    if half_angle > math.pi / 2.0 - 1e-3:
        return 0.0, 0.0
    by_cut = cut_m / (1.0 / math.cos(half_angle) - 1.0)
    radius = min(by_cut, half_piece / math.tan(half_angle))
    return radius, radius * math.tan(half_angle)


def _known(value: float) -> float:
    """The value, 0 for NaN."""
    return 0.0 if math.isnan(value) else value
