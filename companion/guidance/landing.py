"""Which setpoint brings the vehicle down onto the goal? Pure; local ned, ``down_m`` positive downwards.

Closing in: the paper's speed profile along the direction to the goal plus a lateral term on the approach line, given
as a position setpoint just far enough ahead for the autopilot's position loop to ask for that velocity, and as an
acceleration that makes its velocity loop stiffer. Descent: a bounded-rate reference that goes on below the ground until
the autopilot reports ON_GROUND.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.frames import wrap_rad, yaw_rad
from companion.core.params import param
from companion.core.types import F64, VehicleState
from companion.guidance.line import GuidanceLine, line_through

MAX_STEP_S = 0.2  # a longer gap between ticks moves the references no further


@dataclass(frozen=True, slots=True)
class LandingParams:
    """Profile, tolerances and gains of the final approach."""

    k_v: float = param(0.8, "LND_K_V", "closing speed per metre of distance", "1/s", 0.05, 3.0)
    v_min_m_s: float = param(0.15, "LND_V_MIN", "slowest closing speed", "m/s", 0.0, 2.0)
    v_max_m_s: float = param(1.5, "LND_V_MAX", "fastest closing speed", "m/s", 0.1, 5.0)
    k_perp: float = param(0.3, "LND_K_PERP", "lateral speed per metre off the approach line", "1/s", 0.0, 3.0)
    k_perp_d: float = param(0.1, "LND_K_PERP_D", "lateral speed taken off per lateral speed", "", 0.0, 1.0)
    kp_pos: float = param(0.95, "LND_KP_POS", "position gain of the autopilot (MPC_XY_P)", "1/s", 0.1, 5.0)
    k_acc: float = param(2.2, "LND_K_ACC", "acceleration feed-forward per velocity error", "1/s", 0.0, 2.5)
    a_max_m_s2: float = param(4.0, "LND_A_MAX", "limit of that acceleration", "m/s2", 0.0, 6.0)
    r_desc_m: float = param(0.4, "LND_R_DESC", "descent only nearer to the goal than this", "m", 0.05, 5.0)
    r_touch_m: float = param(0.2, "LND_R_TOUCH", "the same near the ground", "m", 0.05, 5.0)
    r_slope: float = param(0.1, "LND_R_SLOPE", "how fast the one widens to the other with height", "", 0.0, 2.0)
    h_commit_m: float = param(0.1, "LND_H_COMMIT", "lower than this the descent goes on anywhere near", "m", 0.0, 1.0)
    psi_desc_rad: float = param(0.35, "LND_PSI_DESC", "descent only with a smaller heading error", "rad", 0.05, 3.2)
    r_yaw_m: float = param(0.5, "LND_R_YAW", "nearer than this the approach direction is kept", "m", 0.0, 5.0)
    k_z: float = param(0.5, "LND_K_Z", "descent rate per metre of height", "1/s", 0.05, 3.0)
    vz_max_m_s: float = param(1.5, "LND_VZ_MAX", "fastest descent (MPC_Z_VEL_MAX_DN)", "m/s", 0.1, 3.0)
    vz_min_m_s: float = param(0.5, "LND_VZ_MIN", "descent near and below the ground", "m/s", 0.1, 1.0)
    az_m_s2: float = param(1.5, "LND_AZ", "how fast the descent rate may grow", "m/s2", 0.1, 10.0)
    z_lead_m: float = param(0.8, "LND_Z_LEAD", "reference at most this far below the vehicle", "m", 0.1, 3.0)
    z_below_m: float = param(2.0, "LND_Z_BELOW", "reference at most this far below the goal", "m", 0.0, 10.0)
    r_tol_m: float = param(0.3, "LND_R_TOL", "touchdown: distance", "m", 0.01, 2.0)
    h_tol_m: float = param(0.3, "LND_H_TOL", "touchdown: height", "m", 0.01, 2.0)
    v_tol_m_s: float = param(0.2, "LND_V_TOL", "touchdown: speed", "m/s", 0.01, 2.0)
    psi_tol_rad: float = param(0.35, "LND_PSI_TOL", "touchdown: heading error", "rad", 0.01, 3.2)
    settle_s: float = param(1.0, "LND_T_SETTLE", "touchdown: all of it for this long", "s", 0.0, 10.0)


@dataclass(frozen=True, slots=True)
class LandingState:
    """What one landing remembers."""

    t_s: float
    line: GuidanceLine  # from the place of entry to the goal
    goal_down_m: float  # the ground
    down_ref_m: float
    rate_m_s: float  # of down_ref_m
    yaw_ref_rad: float
    yaw_kept: bool  # came within r_yaw_m: the direction no longer turns
    settled_s: float


@dataclass(frozen=True, slots=True)
class LandingCommand:
    """What to ask of the autopilot, and what the landing says of itself."""

    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,) feed-forward: descent only
    acc_ned_m_s2: F64  # (3,) feed-forward: horizontal only
    yaw_rad: float
    descending: bool
    touchdown: bool


def start(state: VehicleState, goal_ned_m: F64, goal_down_m: float, down_sp_m: float) -> LandingState:
    """Enter Landing at ``state`` for the goal (2,) on ground ``goal_down_m``.

    The reference starts at ``down_sp_m``, the height asked for so far, or at the vehicle where that is lower: a second
    attempt does not climb first.
    """
    return LandingState(
        t_s=state.t_s,
        line=line_through(state.pos_ned_m[:2], goal_ned_m),
        goal_down_m=goal_down_m,
        down_ref_m=max(down_sp_m, float(state.pos_ned_m[2])),
        rate_m_s=0.0,
        yaw_ref_rad=yaw_rad(state.q_ned_frd),
        yaw_kept=False,
        settled_s=0.0,
    )


def step(
    landing: LandingState, state: VehicleState, safe: bool, params: LandingParams
) -> tuple[LandingState, LandingCommand]:
    """One tick. ``safe`` false pauses the descent at once, whatever the arbiter decides later."""
    dt_s = min(max(state.t_s - landing.t_s, 0.0), MAX_STEP_S)
    landing = _aligned(replace(landing, t_s=state.t_s), state, params)
    descending = safe and _may_descend(landing, state, params)
    landing = _lowered(landing, float(state.pos_ned_m[2]), dt_s if descending else 0.0, params)
    landing = replace(landing, settled_s=landing.settled_s + dt_s if _settled(landing, state, params) else 0.0)
    velocity = closing_velocity(landing.line, state, params)
    sp_ned_m = state.pos_ned_m[:2] + velocity / params.kp_pos
    return landing, LandingCommand(
        pos_ned_m=np.array([sp_ned_m[0], sp_ned_m[1], landing.down_ref_m]),
        vel_ned_m_s=np.array([0.0, 0.0, landing.rate_m_s]),
        acc_ned_m_s2=_acceleration(velocity - state.vel_ned_m_s[:2], params),
        yaw_rad=landing.yaw_ref_rad,
        descending=descending,
        touchdown=landing.settled_s > 0.0 and landing.settled_s >= params.settle_s,
    )


def closing_speed(distance_m: float, params: LandingParams) -> float:
    """Speed towards the goal (eq. land_speed), never more than what the position loop asks for at the goal itself."""
    profile = min(max(params.k_v * distance_m, params.v_min_m_s), params.v_max_m_s)
    return min(profile, params.kp_pos * distance_m)


def closing_velocity(line: GuidanceLine, state: VehicleState, params: LandingParams) -> F64:
    """Horizontal velocity (2,): towards the goal, plus a small PD on the approach line (eq. land_lateral)."""
    to_goal = line.goal_ned_m - state.pos_ned_m[:2]
    distance_m = float(np.hypot(to_goal[0], to_goal[1]))
    cross_track_m = float(line.n @ (state.pos_ned_m[:2] - line.origin_ned_m))
    cross_rate_m_s = float(line.n @ state.vel_ned_m_s[:2])
    lateral = -(params.k_perp * cross_track_m + params.k_perp_d * cross_rate_m_s)
    along = closing_speed(distance_m, params) / distance_m if distance_m > 0.0 else 0.0
    velocity: F64 = along * to_goal + lateral * line.n
    return velocity


def descent_rate(height_m: float, params: LandingParams) -> float:
    """Downward rate of the reference (eq. land_descent) with a floor that carries it through the ground."""
    return min(max(params.k_z * height_m, params.vz_min_m_s), params.vz_max_m_s)


def descent_radius(height_m: float, params: LandingParams) -> float:
    """How far from the goal the vehicle may sink: a funnel, open again where it already touches the ground."""
    if height_m < params.h_commit_m:
        return params.r_desc_m
    return min(params.r_touch_m + params.r_slope * height_m, params.r_desc_m)


def _acceleration(error_m_s: F64, params: LandingParams) -> F64:
    """Feed-forward (3,) towards the velocity asked for, limited in norm."""
    norm_m_s2 = params.k_acc * float(np.hypot(error_m_s[0], error_m_s[1]))
    gain = params.k_acc * min(1.0, params.a_max_m_s2 / norm_m_s2) if norm_m_s2 > 0.0 else 0.0
    return np.array([gain * error_m_s[0], gain * error_m_s[1], 0.0])


def _aligned(landing: LandingState, state: VehicleState, params: LandingParams) -> LandingState:
    """Yaw towards the goal; once near, the direction is undefined and the last one is kept."""
    if landing.yaw_kept or not _distance_m(landing, state) > params.r_yaw_m:
        return replace(landing, yaw_kept=True)
    to_goal = landing.line.goal_ned_m - state.pos_ned_m[:2]
    return replace(landing, yaw_ref_rad=math.atan2(float(to_goal[1]), float(to_goal[0])))


def _distance_m(landing: LandingState, state: VehicleState) -> float:
    to_goal = landing.line.goal_ned_m - state.pos_ned_m[:2]
    return float(np.hypot(to_goal[0], to_goal[1]))


def _yaw_error_rad(landing: LandingState, state: VehicleState) -> float:
    return abs(wrap_rad(yaw_rad(state.q_ned_frd) - landing.yaw_ref_rad))


def _may_descend(landing: LandingState, state: VehicleState, params: LandingParams) -> bool:
    radius_m = descent_radius(landing.goal_down_m - float(state.pos_ned_m[2]), params)
    return _distance_m(landing, state) < radius_m and _yaw_error_rad(landing, state) < params.psi_desc_rad


def _lowered(landing: LandingState, down_m: float, dt_s: float, params: LandingParams) -> LandingState:
    """Move the height reference for ``dt_s`` of descent; none pauses it."""
    if dt_s <= 0.0:
        return replace(landing, rate_m_s=0.0)
    wanted = descent_rate(landing.goal_down_m - down_m, params)
    rate = min(wanted, landing.rate_m_s + params.az_m_s2 * dt_s)
    lowest_m = min(down_m + params.z_lead_m, landing.goal_down_m + params.z_below_m)
    down_ref_m = max(landing.down_ref_m, min(landing.down_ref_m + rate * dt_s, lowest_m))
    return replace(landing, down_ref_m=down_ref_m, rate_m_s=rate)


def _settled(landing: LandingState, state: VehicleState, params: LandingParams) -> bool:
    """Everything of eq. land_terminate at this instant."""
    return (
        _distance_m(landing, state) < params.r_tol_m
        and abs(float(state.pos_ned_m[2]) - landing.goal_down_m) < params.h_tol_m
        and float(np.linalg.norm(state.vel_ned_m_s)) < params.v_tol_m_s
        and _yaw_error_rad(landing, state) < params.psi_tol_rad
    )
