"""Which setpoint keeps the vehicle on its path? The one line follower of Travel and RL; pure; local ned.

Position setpoint = the nearest place of the path, advanced by the transport delay only; velocity feed-forward = the
direction of the path read where the velocity loop will be; acceleration feed-forward = a velocity loop closed over the
link (a long position carrot cuts corners, and firmware gains alone lag in slaloms).
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core import geometry
from companion.core.params import param
from companion.core.types import F64, Setpoint, VehicleState


@dataclass(frozen=True, slots=True)
class FollowerParams:
    """Figures of the line follower, for an autopilot with PX4's gains."""

    delay_s: float = param(0.05, "FOL_DELAY", "transport delay from scan to setpoint", "s", 0.0, 1.0)
    lead_s: float = param(0.3, "FOL_LEAD", "how far ahead the direction is read", "s", 0.0, 2.0)
    blend_m: float = param(0.10, "FOL_BLEND", "half length of path over which a direction is read", "m", 0.0, 1.0)
    pull_1_s: float = param(0.95, "FOL_PULL", "position gain of the autopilot (MPC_XY_P)", "1/s", 0.1, 3.0)
    acc_gain_1_s: float = param(2.2, "FOL_ACC_GAIN", "acceleration asked per velocity error", "1/s", 0.0, 2.5)
    acc_max_m_s2: float = param(4.0, "FOL_ACC_MAX", "bound of the acceleration feed-forward", "m/s2", 0.0, 7.0)
    offset_max_m: float = param(0.8, "FOL_OFFSET_MAX", "farthest position setpoint from the vehicle", "m", 0.1, 5.0)
    window_m: float = param(1.0, "FOL_WINDOW", "arc length ahead in which the nearest place is sought", "m", 0.1, 10.0)
    off_path_m: float = param(0.12, "FOL_OFF_PATH", "distance from the path that costs no speed", "m", 0.0, 1.0)
    off_path_gain_1_m: float = param(1.5, "FOL_OFF_GAIN", "share of speed lost per metre beyond it", "1/m", 0.0, 10.0)
    off_path_share: float = param(0.3, "FOL_OFF_SHARE", "share of the speed kept far from the path", "", 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Target:
    """What to follow the path with."""

    speed_m_s: float  # along the path, limits applied
    down_m: float
    yaw_rad: float
    course_rad: float | None = None  # direction of the velocity where a line law corrects it; None: along the path


@dataclass(frozen=True, slots=True)
class Followed:
    """The setpoint, and where on the path the vehicle is; ``s_m`` never decreases."""

    setpoint: Setpoint
    s_m: float
    lateral_m: float  # right of the path is positive
    distance_m: float


def progress(path_ned_m: F64, pos_ned_m: F64, s_min_m: float, params: FollowerParams) -> geometry.Projection:
    """Nearest place of the path in the window ahead of s_min_m: never back, never across to a near later piece."""
    return geometry.project(path_ned_m, pos_ned_m, s_min_m, s_min_m + params.window_m)


def follow(
    path_ned_m: F64, state: VehicleState, at: geometry.Projection, target: Target, params: FollowerParams
) -> Followed:
    """Setpoint that follows the path from ``progress`` on. A NaN state asks to stay where the path is."""
    pieces = geometry.segments(path_ned_m)
    speed = target.speed_m_s * _share_off_path(at.distance_m, params)
    if target.course_rad is None:
        vel_n, vel_e = _velocity(pieces, at.s_m + speed * params.lead_s, speed, params)
    else:
        vel_n, vel_e = speed * math.cos(target.course_rad), speed * math.sin(target.course_rad)
    place_n, place_e = _place(pieces, at.s_m + speed * params.delay_s, path_ned_m)
    here_n, here_e = float(state.pos_ned_m[0]), float(state.pos_ned_m[1])
    if not at.distance_m < math.inf:
        here_n, here_e = place_n, place_e
    off_n, off_e = geometry.shortened(place_n - here_n, place_e - here_e, params.offset_max_m)
    want_n, want_e = vel_n + params.pull_1_s * off_n, vel_e + params.pull_1_s * off_e
    acc_n, acc_e = geometry.shortened(
        params.acc_gain_1_s * (want_n - float(state.vel_ned_m_s[0])),
        params.acc_gain_1_s * (want_e - float(state.vel_ned_m_s[1])),
        params.acc_max_m_s2,
    )
    setpoint = Setpoint(
        state.t_s,
        np.array([here_n + off_n, here_e + off_e, target.down_m]),
        np.array([vel_n, vel_e, 0.0]),
        np.array([acc_n, acc_e, 0.0]),
        target.yaw_rad,
    )
    return Followed(setpoint, at.s_m, at.lateral_m, at.distance_m)


def _velocity(
    pieces: tuple[geometry.Segment, ...], s_m: float, speed_m_s: float, params: FollowerParams
) -> tuple[float, float]:
    """Velocity along the chord of the path around s_m; the direction of the path where that chord vanishes."""
    here = geometry.segment_at(pieces, s_m)
    if here is None:
        return 0.0, 0.0
    end_s = pieces[-1].s_m + pieces[-1].length_m
    middle = min(max(s_m, params.blend_m), max(end_s - params.blend_m, 0.0))
    back_n, back_e = geometry.place_at(pieces, middle - params.blend_m)
    on_n, on_e = geometry.place_at(pieces, middle + params.blend_m)
    chord = math.hypot(on_n - back_n, on_e - back_e)
    if chord < 0.5 * params.blend_m:
        return speed_m_s * here.dir_north, speed_m_s * here.dir_east
    return speed_m_s * (on_n - back_n) / chord, speed_m_s * (on_e - back_e) / chord


def _place(pieces: tuple[geometry.Segment, ...], s_m: float, path_ned_m: F64) -> tuple[float, float]:
    return geometry.place_at(pieces, s_m) if pieces else (float(path_ned_m[0, 0]), float(path_ned_m[0, 1]))


def _share_off_path(distance_m: float, params: FollowerParams) -> float:
    """Share of the speed kept at a distance from the path; none for a place that is not known."""
    if not distance_m < math.inf:
        return 0.0
    return max(params.off_path_share, 1.0 - params.off_path_gain_1_m * max(distance_m - params.off_path_m, 0.0))
