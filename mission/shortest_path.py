"""How long is the shortest way for the vehicle?  The length that flown paths are compared with; pure, world ned.

Dijkstra on a grid of exact clearances, then every stretch that a straight line can replace is replaced, then the rest
is pulled tight. Movers do not count. Round single discs the length was within 0.04 % of two tangents and an arc.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from companion.core.types import F64
from mission.world_check import CELL_M, clearance_grid, distances_m
from sitl.world import World

NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))  # and their opposites
RESAMPLE_M = 0.5  # vertices of the second pass of straightening: corners become tangents
PASSES = 3
PULLS = 600
REACH_M = 30.0  # beside half the distance: how far round a way may lead


def shortest_path_m(world: World, from_ned_m: F64, to_ned_m: F64, radius_m: float, cell_m: float = CELL_M) -> float:
    """Length from (n, e) to (n, e) for a disc of ``radius_m``; inf when there is no way."""
    path = shortest_path(world, from_ned_m, to_ned_m, radius_m, cell_m)
    return math.inf if path is None else float(np.hypot(*np.diff(path, axis=0).T).sum())


def shortest_path(world: World, from_ned_m: F64, to_ned_m: F64, radius_m: float, cell_m: float = CELL_M) -> F64 | None:
    """The way (k, 2) itself, or None."""
    if straight_free(world, from_ned_m, to_ned_m, radius_m):
        return np.stack([from_ned_m, to_ned_m])
    world = _near(world, from_ned_m, to_ned_m)
    field, cell_m = clearance_grid(world, 2.0 * radius_m, cell_m)
    origin = np.array(world.bounds_m[:2])
    grid = _Grid(field, origin, cell_m, radius_m)
    ends = np.stack([from_ned_m, to_ned_m])
    cells = grid.cells(ends)
    for row, column in cells:  # an end that is a little too near to something is still where the way begins
        field[row, column] = max(field[row, column], radius_m)
    steps = _dijkstra(field >= radius_m, cells)
    if steps is None:
        return None
    path = np.concatenate([ends[:1], origin + steps[1:-1] * cell_m, ends[1:]])
    for _ in range(PASSES):
        path = grid.straightened(_resampled(path))
    return grid.tightened(_resampled(path))


class _Grid:
    """Clearances between the cells, bilinear."""

    def __init__(self, field: F64, origin: F64, cell_m: float, radius_m: float) -> None:
        self._field, self._origin, self._cell_m, self._radius_m = field, origin, cell_m, radius_m

    def cells(self, points: F64) -> NDArray[np.intp]:
        """Nearest cells (n, 2) of points (n, 2)."""
        nearest = np.rint((points - self._origin) / self._cell_m).astype(np.intp)
        return np.clip(nearest, 0, np.array(self._field.shape) - 1)

    def straightened(self, path: F64) -> F64:
        """From each vertex kept straight on to the farthest one in free sight."""
        kept = [0]
        while kept[-1] < len(path) - 1:
            here = kept[-1]
            ahead = range(len(path) - 1, here + 1, -1)
            kept.append(next((k for k in ahead if self._free(path[here], path[k])), here + 1))
        return path[kept]

    def tightened(self, path: F64) -> F64:
        """A string pulled tight: every vertex to between its neighbours, then out of what it went into."""
        path = path.copy()
        for _ in range(PULLS):
            path[1:-1] = (path[:-2] + path[2:]) / 2.0
            inside_m = self._radius_m - self._clearance(path[1:-1])
            if np.any(inside_m > 0.0):
                path[1:-1] += np.maximum(inside_m, 0.0)[:, None] * self._outward(path[1:-1])
        return path

    def _outward(self, points: F64) -> F64:
        """Unit vectors (n, 2) of growing clearance; zero where it is flat."""
        step = self._cell_m / 2.0
        slope = np.stack(
            [self._clearance(points + d) - self._clearance(points - d) for d in step * np.eye(2)],
            axis=1,
        )
        length = np.hypot(*slope.T)[:, None]
        unit: F64 = np.divide(slope, length, out=np.zeros_like(slope), where=length > 0.0)
        return unit

    def _free(self, a: F64, b: F64) -> bool:
        count = max(2, math.ceil(math.dist(a, b) / self._cell_m) + 1)
        points = a + np.linspace(0.0, 1.0, count)[1:-1, None] * (b - a)
        return bool(np.all(self._clearance(points) >= self._radius_m))

    def _clearance(self, points: F64) -> F64:
        """Bilinear, (n,)."""
        at = (points - self._origin) / self._cell_m
        cell = np.clip(at.astype(np.intp), 0, np.array(self._field.shape) - 2)
        (i, j), (u, v) = cell.T, np.clip(at - cell, 0.0, 1.0).T
        lower = self._field[i, j] * (1 - v) + self._field[i, j + 1] * v
        upper = self._field[i + 1, j] * (1 - v) + self._field[i + 1, j + 1] * v
        along: F64 = lower * (1 - u) + upper * u
        return along


def straight_free(world: World, from_ned_m: F64, to_ned_m: F64, radius_m: float) -> bool:
    """Does a disc get straight from one place to the other?"""
    share = np.linspace(0.0, 1.0, max(2, math.ceil(math.dist(from_ned_m, to_ned_m) / CELL_M)))[1:-1, None]
    places = from_ned_m + share * (to_ned_m - from_ned_m)
    return all((distance_m >= radius_m).all() for distance_m in distances_m(world, places))


def _near(world: World, from_ned_m: F64, to_ned_m: F64) -> World:
    """The part of a wide world in which the shortest way is looked for."""
    ends = np.stack([from_ned_m, to_ned_m])
    reach_m = REACH_M + math.dist(from_ned_m, to_ned_m) / 2
    low = np.maximum(ends.min(axis=0) - reach_m, world.bounds_m[:2])
    high = np.minimum(ends.max(axis=0) + reach_m, world.bounds_m[2:])
    return dataclasses.replace(world, bounds_m=(float(low[0]), float(low[1]), float(high[0]), float(high[1])))


def _dijkstra(free: NDArray[np.bool_], ends: NDArray[np.intp]) -> F64 | None:
    """Cells (k, 2) from the first end to the second, or None."""
    index = np.arange(free.size).reshape(free.shape)
    rows, columns, costs = [], [], []
    for down, right in NEIGHBOURS:
        here, there = shifted(free.shape, down, right)
        open_ = free[here] & free[there]
        rows.append(index[here][open_])
        columns.append(index[there][open_])
        costs.append(np.full(len(rows[-1]), math.hypot(down, right)))
    edges = (np.concatenate(rows), np.concatenate(columns))
    graph = csr_array((np.concatenate(costs), edges), shape=(free.size, free.size))
    first, last = (int(index[tuple(end)]) for end in ends)
    _, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    if first != last and before[last] < 0:
        return None
    chain = [last]
    while chain[-1] != first:
        chain.append(int(before[chain[-1]]))
    return np.stack(np.unravel_index(chain[::-1], free.shape), axis=1).astype(np.float64)


def shifted(shape: tuple[int, ...], down: int, right: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Two views of a grid: cells, and what lies ``down`` rows and ``right`` columns from them."""
    height, width = shape
    here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
    there = (slice(down, height), slice(max(0, right), width + min(0, right)))
    return here, there


def _resampled(path: F64) -> F64:
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.union1d(lengths, np.arange(0.0, lengths[-1], RESAMPLE_M))
    return np.stack([np.interp(at, lengths, path[:, 0]), np.interp(at, lengths, path[:, 1])], axis=1)
