"""Questions for a policy, and their mirror images."""

from dataclasses import replace
from typing import Any

import numpy as np

from companion.core import gridmap
from companion.core.frames import quaternion
from companion.core.gridmap import GridMap, MapParams
from companion.core.types import F64, VehicleState
from companion.perception.observation import observation
from companion.policy.interface import Query

MAP = MapParams()
NOW_S = 10.0
EAST = np.array([1.0, -1.0])
IN_SPACE = np.array([1.0, -1.0, 1.0])
NOTHING = np.empty((0, 2))


def known(hits_ne_m: F64) -> GridMap:
    """A map round the origin that holds exactly these hits; all the rest free."""
    grid = gridmap.empty(MAP)
    grid.free_t[:] = NOW_S
    cells, inside = gridmap.cells_of(grid, hits_ne_m)
    grid.hit_t.ravel()[cells[inside]] = NOW_S
    grid.hit_ne_m.reshape(-1, 2)[cells[inside]] = hits_ne_m[inside]
    return grid


def query(
    pos_ne_m: Any = (0.0, 0.0),
    goal_ne_m: Any = (20.0, 0.0),
    hits_ne_m: F64 = NOTHING,
    prefix_ne_m: Any = None,
    vel_ne_m_s: Any = (0.0, 0.0),
    yaw_rad: float = 0.0,
    start_ne_m: Any = (0.0, 0.0),
    t_s: float = NOW_S,
    grid: GridMap | None = None,
) -> Query:
    pos, goal, start = (np.array(place, dtype=float) for place in (pos_ne_m, goal_ne_m, start_ne_m))
    attitude = quaternion(0.05, -0.02, yaw_rad)
    velocity = np.array([*vel_ne_m_s, 0.1])
    state = VehicleState(t_s, np.array([*pos, -2.5]), velocity, attitude, np.array([0.1, 0.2, 0.3]))
    prefix = pos[None] if prefix_ne_m is None else np.array(prefix_ne_m, dtype=float)
    numbers = observation(state, hits_ne_m, start, goal)
    return Query(state, goal, known(hits_ne_m) if grid is None else grid, NOTHING, 0.33, prefix, numbers, start)


def mirrored(one: Query) -> Query:
    """East and west exchanged; obstacles as movers, whose places are exact: cells have no mirror image."""
    state = one.state
    there = VehicleState(
        state.t_s,
        state.pos_ned_m * IN_SPACE,
        state.vel_ned_m_s * IN_SPACE,
        state.q_ned_frd * np.array([1.0, -1.0, 1.0, -1.0]),
        state.rates_frd_rad_s * -IN_SPACE,
    )
    goal, start, hazard = one.goal_ne_m * EAST, one.start_ne_m * EAST, one.hazard_ne_m * EAST
    numbers = observation(there, hazard, start, goal)
    return replace(
        one,
        state=there,
        goal_ne_m=goal,
        start_ne_m=start,
        hazard_ne_m=hazard,
        prefix_ne_m=one.prefix_ne_m * EAST,
        observation=numbers,
    )


def with_movers(one: Query, hazard_ne_m: F64) -> Query:
    """The query with these obstacles besides, and in the 72 numbers."""
    numbers = observation(one.state, hazard_ne_m, one.start_ne_m, one.goal_ne_m)
    return replace(one, hazard_ne_m=hazard_ne_m, observation=numbers)
