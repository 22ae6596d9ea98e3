"""How long would the rest of the way take from here, for somebody who knows the world? For rewards only; world ned.

Seconds to the goal for a vehicle that is slower beside obstacles, as the navigator is. The drop of this time is a
reward that tells at once which side of a barrier was the right one. It is shaping in the manner of Ng 1999, but without
his discount, so it may favour early drops a little. A policy that flies never sees it.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from companion.core.types import F64
from companion.guidance.limits import LimitsParams
from mission.shortest_path import NEIGHBOURS, shifted
from mission.world_check import clearance_grid
from sitl.world import World

CELL_M = 0.3
LIMITS = LimitsParams()
WORLDS = 64  # whose fields are kept
SLOWEST_M_S = 0.3  # where the vehicle does not fit: a way out of there, too


class WayField:
    """Seconds to the goal, cell by cell."""

    def __init__(self, seconds: F64, origin_ne_m: tuple[float, float], cell_m: float) -> None:
        self._seconds, self._origin_ne_m, self._cell_m = seconds, origin_ne_m, cell_m

    def at(self, north_m: float, east_m: float) -> float:
        """Between the four cells round a place, bilinear; a place outside counts as the nearest one inside."""
        rows, columns = self._seconds.shape
        i = min(max((north_m - self._origin_ne_m[0]) / self._cell_m, 0.0), rows - 1.001)
        j = min(max((east_m - self._origin_ne_m[1]) / self._cell_m, 0.0), columns - 1.001)
        row, column = int(i), int(j)
        u, v = i - row, j - column
        (a, b), (c, d) = self._seconds[row : row + 2, column : column + 2].tolist()
        return float((a * (1 - v) + b * v) * (1 - u) + (c * (1 - v) + d * v) * u)


@lru_cache(maxsize=WORLDS)
def way_field(world: World, radius_m: float, cruise_m_s: float) -> WayField:
    """The field of a world. Movers do not count."""
    clearance, cell_m = clearance_grid(world, radius_m + LIMITS.side_full_m, CELL_M)
    cell_s = cell_m / speed_m_s(clearance, radius_m, cruise_m_s)
    seconds = _seconds_to(_cell_of(world, clearance.shape, cell_m), cell_s, clearance >= radius_m)
    reached = np.isfinite(seconds)
    apart, nearest = distance_transform_edt(~reached, return_indices=True)
    seconds = seconds[tuple(nearest)] + apart * cell_m / SLOWEST_M_S
    return WayField(seconds, world.bounds_m[:2], cell_m)


def speed_m_s(clearance_m: F64, radius_m: float, cruise_m_s: float) -> F64:
    """How fast the navigator flies that near to obstacles."""
    beside = np.clip((clearance_m - radius_m) / LIMITS.side_full_m, 0.0, 1.0)
    speed: F64 = LIMITS.side_min_m_s + (cruise_m_s - LIMITS.side_min_m_s) * beside
    return speed


def _cell_of(world: World, shape: tuple[int, ...], cell_m: float) -> tuple[int, int]:
    row, column = ((g - o) / cell_m for g, o in zip(world.goal_ned_m[:2].tolist(), world.bounds_m[:2], strict=True))
    return min(max(round(row), 0), shape[0] - 1), min(max(round(column), 0), shape[1] - 1)


def _seconds_to(goal: tuple[int, int], cell_s: F64, free: NDArray[np.bool_]) -> F64:
    """Dijkstra from the goal over free cells; inf where no way leads."""
    index = np.arange(free.size).reshape(free.shape)
    edges, costs = [], []
    for down, right in NEIGHBOURS:
        here, there = shifted(free.shape, down, right)
        open_ = free[here] & free[there]
        edges.append(np.stack([index[here][open_], index[there][open_]]))
        costs.append(math.hypot(down, right) * (cell_s[here][open_] + cell_s[there][open_]) / 2.0)
    rows, columns = np.concatenate(edges, axis=1)
    graph = csr_array((np.concatenate(costs), (rows, columns)), shape=(free.size, free.size))
    seconds: F64 = dijkstra(graph, directed=False, indices=int(index[goal])).reshape(free.shape)
    return seconds
