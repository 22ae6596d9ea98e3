"""What does the policy see? The paper's 72 numbers (eqs. state_intr, state_ctx); pure.

12 intrinsic: position, roll pitch yaw, body rates, velocity; then 20 x (dx, dy, d) of the nearest obstacles, padded
with 55. Position and velocity are in the goal frame (origin at the goal, x along start -> goal), so that the same
numbers mean the same on a map never seen; obstacle offsets are in the body-yaw frame. ``paper=True`` keeps the world
frame of the paper throughout.
"""

import math

import numpy as np

from companion.core.frames import euler_rad, wrap_rad
from companion.core.types import F64, VehicleState

OBSTACLES = 20  # eq. state_ctx
INTRINSIC = 12  # eq. state_intr
SIZE = INTRINSIC + 3 * OBSTACLES  # eq. state_concat
PAD = 55.0  # "dist = 55"


def observation(state: VehicleState, obstacles_ne_m: F64, start_ne_m: F64, goal_ne_m: F64, paper: bool = False) -> F64:
    """The observation, (72,).

    Args:
        state: local NED.
        obstacles_ne_m: (k, 2) representatives, nearest first; those beyond 20 are ignored.
        start_ne_m: (2,) where the line to the goal began.
        goal_ne_m: (2,)
        paper: world frame instead of goal and body-yaw frames.
    """
    roll, pitch, yaw = euler_rad(state.q_ned_frd)
    frame = 0.0 if paper else math.atan2(goal_ne_m[1] - start_ne_m[1], goal_ne_m[0] - start_ne_m[0])
    origin = np.zeros(2) if paper else goal_ne_m
    to_frame = _rotation(-frame)
    out = np.full(SIZE, PAD)
    out[0:2] = to_frame @ (state.pos_ned_m[:2] - origin)
    out[2] = state.pos_ned_m[2]
    out[3:6] = roll, pitch, wrap_rad(yaw - frame)
    out[6:9] = state.rates_frd_rad_s
    out[9:11] = to_frame @ state.vel_ned_m_s[:2]
    out[11] = state.vel_ned_m_s[2]
    offsets = (obstacles_ne_m[:OBSTACLES] - state.pos_ned_m[:2]) @ _rotation(0.0 if paper else -yaw).T
    context = out[INTRINSIC:].reshape(OBSTACLES, 3)
    context[: len(offsets), :2] = offsets
    context[: len(offsets), 2] = np.hypot(offsets[:, 0], offsets[:, 1])
    return out


def nearest_representatives(points_ne_m: F64, pos_ne_m: F64, radius_m: float) -> F64:
    """(k <= 20, 2) the nearest of the points within the sensing radius, nearest first."""
    offset = points_ne_m - pos_ne_m
    square = np.einsum("ij,ij->i", offset, offset)
    order = np.argsort(square, kind="stable")[:OBSTACLES]
    near: F64 = points_ne_m[order[square[order] <= radius_m * radius_m]]
    return near


def _rotation(angle_rad: float) -> F64:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s], [s, c]])
