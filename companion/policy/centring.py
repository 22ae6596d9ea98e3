"""Where is the middle of a gap, finer than cells? Paths and places against the hits themselves; pure; (north, east) m.

A tight gap leaves centimetres, a cell is as wide: the map's clearances cannot tell its middle. What is asked is always
the nearest of a few hundred hits for a hundred places, again and again: one matrix product is quicker than a tree.
"""

import numpy as np
from numpy.typing import NDArray

from companion.core.gridmap import GridMap, centres
from companion.core.types import F64

C128 = NDArray[np.complex128]

QUARTERS = np.array([-1 - 1j, -1 + 1j, 1 - 1j, 1 + 1j]) / 4.0  # places inside a cell of edge 1
AROUND = tuple((di, dj) for di in (-1, 0, 1) for dj in (-1, 0, 1))
SLACK_M = 0.3  # smoothing moves a path by less than this


def centred(path_ne_m: F64, hits_ne_m: F64, want_m: float, push_m: float, sweeps: int) -> F64:
    """An elastic band between hits: every sweep to the middle of the neighbours, then off the nearest hit.

    Args:
        path_ne_m: (k, 2); first and last place stay.
        hits_ne_m: (h, 2) float64.
        want_m: hits nearer than this push,
        push_m: by this much at most.
        sweeps: how often.
    """
    path = _complex(path_ne_m).copy()
    nearest = _Nearest(_close(path, _complex(hits_ne_m), want_m + SLACK_M), path)
    inner = path[1:-1]
    for _ in range(sweeps):
        inner[:] = 0.5 * inner + 0.25 * (path[2:] + path[:-2])
        if nearest.any:
            away = inner - nearest.of(inner)
            distance = np.abs(away)
            away *= np.minimum(np.maximum(want_m - distance, 0.0), push_m) / np.maximum(distance, 1e-6)
            inner += away
    return path.view(np.float64).reshape(-1, 2)


def distances(places_ne_m: F64, hits_ne_m: F64, reach_m: float) -> F64:
    """(k,) from each place to the nearest hit; inf where there is none within reach_m."""
    places = _complex(places_ne_m)
    nearest = _Nearest(_close(places, _complex(hits_ne_m), reach_m), places)
    if not nearest.any:
        return np.full(len(places), np.inf)
    distance: F64 = np.abs(places - nearest.of(places))
    return np.where(distance < reach_m, distance, np.inf)


def opened(grid: GridMap, clearance_m: F64, nearest_cell: NDArray[np.int32], hard_m: float) -> F64:
    """Clearances, of cells that just miss ``hard_m`` the best of four places inside: gaps narrow as cells stay open.

    ``nearest_cell`` (n, n): flat index of the cell whose hit is the nearest; those of the neighbours are tried as well.
    """
    n = len(clearance_m)
    row, column = np.nonzero((clearance_m < hard_m) & (clearance_m > hard_m - 0.5 * grid.cell_m))
    if len(row) == 0:
        return clearance_m
    north, east = centres(grid)
    places = (north[row] + 1j * east[column])[:, None] + grid.cell_m * QUARTERS
    stored = grid.hit_ne_m.reshape(-1).view(np.complex64)
    least = np.full(places.shape, np.inf)
    for di, dj in AROUND:
        beside = nearest_cell[np.minimum(np.maximum(row + di, 0), n - 1), np.minimum(np.maximum(column + dj, 0), n - 1)]
        away = places - stored.take(beside)[:, None]
        np.minimum(least, away.real**2 + away.imag**2, out=least)
    result = clearance_m.copy()
    result[row, column] = np.maximum(clearance_m[row, column], np.sqrt(least.max(axis=1)))
    return result


class _Nearest:
    """Which of some points is the nearest: the least of |p|^2 - 2 p q, in float32 round a middle (exact to 10 um)."""

    def __init__(self, points: C128, around: C128) -> None:
        self.any = len(points) > 0
        self._points = points
        self._middle = around[0]
        offset = points - self._middle
        self._table = np.stack([-2.0 * offset.real, -2.0 * offset.imag, np.abs(offset) ** 2]).astype(np.float32)
        self._asked = np.ones((len(around), 3), np.float32)

    def of(self, places: C128) -> C128:
        """The nearest point of each place; there must be one, and no more places than at first."""
        offset, asked = places - self._middle, self._asked[: len(places)]
        asked[:, 0], asked[:, 1] = offset.real, offset.imag
        found: C128 = self._points.take((asked @ self._table).argmin(axis=1))
        return found


def _close(places: C128, points: C128, reach_m: float) -> C128:
    """The points in the box round the places grown by reach_m."""
    north, east = places.real, places.imag
    inside = (points.real > north.min() - reach_m) & (points.real < north.max() + reach_m)
    inside &= (points.imag > east.min() - reach_m) & (points.imag < east.max() + reach_m)
    close: C128 = points[inside]
    return close


def _complex(places_ne_m: F64) -> C128:
    places: C128 = np.ascontiguousarray(places_ne_m, np.float64).view(np.complex128)[:, 0]
    return places
