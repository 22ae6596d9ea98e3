"""Which numbers does an actor get? Observations by name, scaled to order one; pure; and their mirror images.

| name | size | what |
|---|---|---|
| map | 50 | 36 ranges of the remembered map, 14 numbers of memory; goal frame |
| corridors | 86 | 36 corridors of the vehicle's width besides |
| goal | 72 | the paper's 72 numbers in the goal's frame, obstacle offsets relative to the nose |
| paper | 72 | the same in the world frame, as printed |
"""

import math
from collections.abc import Callable

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.gridmap import MapParams
from companion.core.types import F64
from companion.policy import observation_map, recollection
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import Query

INTRINSIC, OBSTACLES, PAD = 12, 20, 55.0  # layout of the paper's 72 numbers, see ``perception.observation``
NEAR = 2.0  # limit of a scaled number, and so what a missing obstacle reads
SCALE = np.array([20.0, 20.0, 5.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 3.0, 3.0, 3.0, *np.full(3 * OBSTACLES, 10.0)])
MIRROR_72 = np.array([1, -1, 1, -1, 1, -1, -1, 1, -1, 1, -1, 1, *np.tile([1, -1, 1], OBSTACLES)], np.float64)
SIZES = {
    "map": observation_map.RANGES + recollection.FEATURES,
    "corridors": 2 * observation_map.RANGES + recollection.FEATURES,
    "goal": INTRINSIC + 3 * OBSTACLES,
    "paper": INTRINSIC + 3 * OBSTACLES,
}


def observe(name: str, query: Query, memory: F64 | None, params: MapParams) -> F64:
    """The observation of that name.

    Args:
        name: one of ``SIZES``.
        query: what the policy is asked.
        memory: what ``remember`` returned after the last decision, None at first.
        params: of the map.
    """
    return _OBSERVERS[name](query, memory, params)


def remember(query: Query, memory: F64 | None, heading_rad: float, turn: float) -> F64:
    """The memory for the next decision: the present moment, and the heading off the goal bearing chosen in it."""
    return recollection.decided(recollection.entered(query, memory), goal_frame(query).course_rad + heading_rad, turn)


def last_heading_rad(query: Query, memory: F64 | None) -> float | None:
    """The heading off the goal bearing that was chosen last; None before the first."""
    course_rad = None if memory is None else recollection.last_course_rad(memory)
    return None if course_rad is None else course_rad - goal_frame(query).course_rad


def mirror_observation(name: str, observation: F64) -> F64:
    """The observation (..., size) of the mirror image."""
    if name in ("goal", "paper"):
        missing = np.repeat(observation[..., INTRINSIC + 2 :: 3] == NEAR, 3, axis=-1)
        image = observation * MIRROR_72
        image[..., INTRINSIC:] = np.where(missing, NEAR, image[..., INTRINSIC:])
        return image
    sectors = observation[..., : -recollection.FEATURES]
    memory = observation[..., -recollection.FEATURES :] * recollection.MIRROR
    parts = [
        observation_map.mirrored(sectors[..., at : at + observation_map.RANGES])
        for at in range(0, sectors.shape[-1], observation_map.RANGES)
    ]
    return np.concatenate([*parts, memory], axis=-1)


def _map(query: Query, memory: F64 | None, params: MapParams, corridors: bool = False) -> F64:
    frame = goal_frame(query)
    points = observation_map.obstacles(query, frame, params)
    parts = [observation_map.ranges(points, params.sense_m)]
    if corridors:
        half_width_m = query.radius_m + observation_map.CORRIDOR_MARGIN_M
        parts.append(observation_map.corridors(points, half_width_m, params.sense_m))
    parts.append(recollection.features(query, recollection.entered(query, memory), frame))
    return np.concatenate(parts)


def _corridors(query: Query, memory: F64 | None, params: MapParams) -> F64:
    return _map(query, memory, params, corridors=True)


def _goal(query: Query, memory: F64 | None, params: MapParams) -> F64:
    return _scaled(query.observation)


def _paper(query: Query, memory: F64 | None, params: MapParams) -> F64:
    """The 72 numbers turned back into the world frame."""
    yaw = yaw_rad(query.state.q_ned_frd)
    out = query.observation.copy()
    out[0:2] = query.state.pos_ned_m[:2]
    out[5] = yaw
    out[9:11] = query.state.vel_ned_m_s[:2]
    context = out[INTRINSIC:].reshape(OBSTACLES, 3)
    there = context[:, 2] != PAD
    c, s = math.cos(yaw), math.sin(yaw)
    context[there, :2] = context[there, :2] @ np.array([[c, s], [-s, c]])
    return _scaled(out)


def _scaled(numbers: F64) -> F64:
    """Order one; obstacles no farther than ``NEAR``."""
    out: F64 = numbers / SCALE
    np.clip(out[INTRINSIC:], -NEAR, NEAR, out=out[INTRINSIC:])
    return out


_OBSERVERS: dict[str, Callable[[Query, F64 | None, MapParams], F64]] = {
    "map": _map,
    "corridors": _corridors,
    "goal": _goal,
    "paper": _paper,
}
