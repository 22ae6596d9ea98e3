"""What is the cheapest way over the remembered map? Distance field, cost field, Dijkstra; pure; cells of a GridMap.

SciPy does the graph work in C; the edge list of a square grid is built once per size.
"""

import math
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


@dataclass(frozen=True, slots=True)
class Reach:
    """Cost from one cell to every other, and how to walk back."""

    cost: F64  # (n * n,) inf where unreachable
    previous: NDArray[np.int32]  # (n * n,)


def clearance_field(grid: GridMap, occupied: NDArray[np.bool_]) -> F64:
    """(n, n) metres from each cell centre to the nearest remembered hit (to the hit, not to its cell)."""
    if not occupied.any():
        return np.full(occupied.shape, np.inf)
    nearest = distance_transform_edt(~occupied, return_distances=False, return_indices=True)
    hit = grid.hit_ne_m[nearest[0], nearest[1]]
    north, east = centres(grid)
    dn, de = hit[..., 0] - north[:, None], hit[..., 1] - east[None, :]
    clearance: F64 = np.sqrt(dn * dn + de * de)
    return clearance


def reach_from(cell_cost: F64, source: int) -> Reach:
    """Dijkstra over the 8-connected grid; an edge costs its length in cells times the mean cost of its ends.

    Args:
        cell_cost: (n, n) at least 1; BLOCKED where nothing may pass.
        source: flat index of the first cell.
    """
    edges = _edges(cell_cost.shape[0])
    cost = cell_cost.ravel()
    half = (cost.take(edges.tail) + cost.take(edges.head)) * edges.half_length
    graph = csr_matrix((half.take(edges.order), edges.column, edges.row_start), shape=(cost.size, cost.size))
    distance, previous = dijkstra(graph, indices=source, return_predecessors=True, limit=LIMIT)
    return Reach(distance, previous)


def walk_back(reach: Reach, target: int) -> list[int]:
    """Flat cells from the source to ``target``."""
    path = [target]
    while (cell := int(reach.previous[path[-1]])) >= 0:
        path.append(cell)
    return path[::-1]


@dataclass(frozen=True, slots=True)
class _Edges:
    tail: NDArray[np.intp]  # (e,) each undirected edge once
    head: NDArray[np.intp]
    half_length: F64
    order: NDArray[np.intp]  # (2 e,) which edge stands at each place of the symmetric matrix
    column: NDArray[np.int32]
    row_start: NDArray[np.int32]


@lru_cache(maxsize=4)
def _edges(n: int) -> _Edges:
    index = np.arange(n * n).reshape(n, n)
    tails, heads, lengths = [], [], []
    for di, dj, step in ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2)), (1, -1, math.sqrt(2))):
        tails.append(index[: n - di, max(0, -dj) : n - max(0, dj)].ravel())
        heads.append(index[di:, max(0, dj) : n - max(0, -dj)].ravel())
        lengths.append(np.full(tails[-1].size, step))
    tail, head, length = np.concatenate(tails), np.concatenate(heads), np.concatenate(lengths)
    row, column = np.concatenate([tail, head]), np.concatenate([head, tail])
    edge = np.tile(np.arange(tail.size), 2)
    order = np.lexsort((column, row))
    row_start = np.searchsorted(row[order], np.arange(n * n + 1))
    return _Edges(
        tail, head, length / 2, edge[order].astype(np.intp), column[order].astype(np.int32), row_start.astype(np.int32)
    )
