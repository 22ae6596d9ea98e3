"""What is the cheapest way over the remembered map? Distance field, A*; pure; cells of a GridMap.

SciPy does the graph work in C: its Dijkstra becomes A* by edges that cost less the more they lead towards the goal. The
columns of a square grid's matrix are built once per size.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from companion.core.gridmap import GridMap, centres
from companion.core.types import F64

BLOCKED = 1e7  # an edge into a blocked cell; beyond LIMIT, so never walked
LIMIT = 1e5
PULL = 0.999  # of what a step wins towards the goal is taken off its cost: less than 1, or rounding made costs negative
Cells = tuple[slice, slice]  # a rectangle of the grid
Way = Callable[[Cells, Cells, float], F64]  # cost of the edges from one to the other, so many cells long
STEPS = ((0, 1), (1, -1), (1, 0), (1, 1))  # half of the eight neighbours, in the order of their flat index


@dataclass(frozen=True, slots=True)
class Reach:
    """Cost from one cell to every other, and how to walk back."""

    cost: F64  # (n * n,) inf where unreachable, or not worth to be looked at
    previous: NDArray[np.int32]  # (n * n,)


def clearance_field(grid: GridMap, occupied: NDArray[np.bool_]) -> F64:
    """(n, n) metres from each cell centre to the nearest remembered hit (to the hit, not to its cell)."""
    return clearances(grid, nearest_cells(occupied)) if occupied.any() else np.full(occupied.shape, np.inf)


def nearest_cells(occupied: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(n, n) flat index of the occupied cell nearest to each; there must be one."""
    nearest = distance_transform_edt(~occupied, return_distances=False, return_indices=True)
    cells: NDArray[np.int32] = nearest[0] * occupied.shape[1] + nearest[1]
    return cells


def clearances(grid: GridMap, nearest_cell: NDArray[np.int32]) -> F64:
    """(n, n) metres from each cell centre to the hit of the cell that is given for it."""
    north, east = centres(grid)
    dn = grid.hit_ne_m[..., 0].take(nearest_cell) - north[:, None]
    de = grid.hit_ne_m[..., 1].take(nearest_cell) - east[None, :]
    dn *= dn
    de *= de
    dn += de
    clearance: F64 = np.sqrt(dn, out=dn)
    return clearance


def reach_from(cell_cost: F64, source: int, ahead: F64, detour: float) -> Reach:
    """Cheapest ways over the 8-connected grid; an edge costs its length in cells times the mean cost of its ends.

    Args:
        cell_cost: (n, n) at least 1; BLOCKED where nothing may pass.
        source: flat index of the first cell.
        ahead: (n, n) straight distance to the goal in cells: no way on can cost less.
        detour: cells through which every way costs so much more than the straight one are left out.
    """

    def way(here: Cells, there: Cells, length: float) -> F64:
        return (cell_cost[here] + cell_cost[there]) * (length / 2)

    return reach_by(way, source, ahead, detour)


def reach_by(way: Way, source: int, ahead: F64, detour: float) -> Reach:
    """The same for edges whose cost is said by ``way``; it may not be less than what they win of ``ahead``."""
    size, pull = ahead.size, PULL * ahead
    graph = csr_matrix((_weights(way, pull), *_columns(ahead.shape[0])), shape=(size, size))
    straight = float(ahead.ravel()[source])
    limit = min(detour, LIMIT) + (1.0 - PULL) * straight
    cost, previous = dijkstra(graph, indices=source, return_predecessors=True, limit=limit)
    cost += PULL * straight - pull.ravel()
    return Reach(cost, previous)


def walk_back(reach: Reach, target: int) -> list[int]:
    """Flat cells from the source to ``target``."""
    path = [target]
    while (cell := int(reach.previous[path[-1]])) >= 0:
        path.append(cell)
    return path[::-1]


def _weights(way: Way, pull: F64) -> F64:
    """Cost of each edge (n * n * 8,), cell by cell; BLOCKED where it would leave the grid."""
    n = pull.shape[0]
    weights = np.empty((n, n, 2 * len(STEPS)))
    weights[0] = weights[-1] = weights[:, 0] = weights[:, -1] = BLOCKED
    for k, (di, dj) in enumerate(STEPS):
        here = slice(0, n - di), slice(max(0, -dj), n - max(0, dj))
        there = slice(di, n), slice(max(0, dj), n - max(0, -dj))
        cost = way(here, there, math.hypot(di, dj))
        won = pull[here] - pull[there]
        np.subtract(cost, won, out=weights[(*here, len(STEPS) + k)])
        np.add(cost, won, out=weights[(*there, len(STEPS) - 1 - k)])
    return weights.ravel()


@lru_cache(maxsize=4)
def _columns(n: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Neighbour of each edge (n * n * 8,), and where the rows begin; an edge that leaves the grid leads to its cell."""
    row, column = (index[..., None] for index in np.indices((n, n)))
    steps = np.array([(-di, -dj) for di, dj in reversed(STEPS)] + list(STEPS))
    to_row, to_column = row + steps[:, 0], column + steps[:, 1]
    inside = (to_row >= 0) & (to_row < n) & (to_column >= 0) & (to_column < n)
    neighbour = np.where(inside, to_row * n + to_column, row * n + column)
    return neighbour.ravel().astype(np.int32), np.arange(n * n + 1, dtype=np.int32) * len(steps)
