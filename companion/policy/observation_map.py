"""How far is it free all round, on the remembered map? Ranges and corridors in the goal frame; pure."""

import math

import numpy as np

from companion.core.gridmap import MapParams, occupied_points
from companion.core.types import F64
from companion.policy.goal_frame import GoalFrame
from companion.policy.interface import Query

RANGES = 36  # one each 10 deg, the first towards the goal, clockwise
CORRIDOR_MARGIN_M = 0.2  # beyond the radius, to either side of a corridor


def hits_ne(query: Query, params: MapParams) -> F64:
    """(k, 2) remembered hits and what movers will sweep, local NED."""
    return np.concatenate([occupied_points(query.grid, query.state.t_s, params), query.hazard_ne_m])


def obstacles(query: Query, frame: GoalFrame, params: MapParams) -> F64:
    """(k, 2) remembered hits and what movers will sweep, in the goal frame, as far as the map senses."""
    points = frame.from_ne(hits_ne(query, params))
    near: F64 = points[np.einsum("ij,ij->i", points, points) < params.sense_m**2]
    return near


def ranges(points: F64, sense_m: float) -> F64:
    """(36,) distance to the nearest point in each sector, as a share of ``sense_m``: 1 where there is none."""
    sector = np.rint(np.arctan2(points[:, 1], points[:, 0]) * (RANGES / math.tau)).astype(np.intp) % RANGES
    nearest = np.full(RANGES, sense_m)
    np.minimum.at(nearest, sector, np.hypot(points[:, 0], points[:, 1]))
    return nearest / sense_m


def corridors(points: F64, half_width_m: float, sense_m: float) -> F64:
    """(36,) how far a disc gets in each direction before it touches a point, as a share of ``sense_m``.

    A range says where something is; a corridor says whether the vehicle fits through beside it.
    """
    bearing = np.arange(RANGES) * (math.tau / RANGES)
    dx, dy = np.cos(bearing)[:, None], np.sin(bearing)[:, None]
    along = dx * points[:, 0] + dy * points[:, 1]  # (36, k)
    lateral = dx * points[:, 1] - dy * points[:, 0]
    square = half_width_m**2 - lateral * lateral
    square[along <= 0.0] = -1.0  # behind
    free = np.where(square > 0.0, along - np.sqrt(np.maximum(square, 0.0)), sense_m)
    shortest: F64 = np.clip(free.min(axis=1, initial=sense_m), 0.0, sense_m)
    return shortest / sense_m


def mirrored(sectors: F64) -> F64:
    """The mirror image (..., 36)."""
    image: F64 = sectors[..., -np.arange(RANGES)]
    return image
