"""How far sideways must the offending waypoints go for the polyline to pass? Pure.

Only waypoints of pieces that come too near to a point move, each along the normal of the proposal, by one of a few
declared shares of ``shift_max_m``. The cheapest combination is found by dynamic programming from waypoint to waypoint;
cost = length + squared shift + squared difference of neighbouring shifts. Of two equal ones the right hand one wins.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.checker.params import CheckerParams
from companion.core import geometry
from companion.core.types import F64

SHARES = np.array([0.0, 0.12, -0.12, 0.25, -0.25, 0.45, -0.45, 0.7, -0.7, 1.0, -1.0])  # of the farthest shift
SHIFT_COST = 1.0  # metres of length per squared metre of shift
SLACK_M = 1e-4  # kept beyond the requirement, so that rounding cannot spoil the final test


class _Layer(NamedTuple):
    """The possible places of one waypoint, and every piece that leads there from those of the one before."""

    places: F64  # (b, 2)
    shifts_m: F64  # (b,) to the right
    point_index: NDArray[np.intp]  # (n,) the points that matter
    distance_m: F64  # (a, b, n) of those points to each piece
    lengths_m: F64  # (a, b)


class Corrector:
    """The displaced versions of one proposal, prepared once and asked at every margin level."""

    def __init__(self, path_ned_m: F64, points_ned_m: F64, radius_m: float, params: CheckerParams) -> None:
        """``path_ned_m`` (k + 1, 2) with the start first; offending pieces are judged at the widest margin."""
        self._path = path_ned_m
        self._radius_m = radius_m
        self._points = points_ned_m
        widest, least = params.margins_m()[0], params.margins_m()[-1]
        self._layers: list[_Layer] = []
        normals = _normals(path_ned_m)
        offending = self._offending(self.required(widest))
        required = self.required(least)
        starts = path_ned_m[:1]
        for i, moves in enumerate(offending):
            shifts = SHARES * params.shift_max_m if moves else np.zeros(1)
            places = path_ned_m[i + 1] + shifts[:, None] * normals[i]
            layer = _layer(starts, places, shifts, points_ned_m, radius_m + widest)
            self._layers.append(_reachable(layer, required))
            starts = self._layers[-1].places
            if len(starts) == 0:
                return

    def required(self, margin_m: float) -> F64:
        """Distance (n,) to keep from each point at a margin level."""
        return geometry.required_distance(self._path[0], self._points, self._radius_m + margin_m, self._radius_m)

    def correct(self, margin_m: float) -> F64 | None:
        """The cheapest correction (k + 1, 2) that passes at the margin; None if there is none."""
        if len(self._layers[-1].shifts_m) == 0:
            return None
        required = self.required(margin_m)
        cost, shifts_m = np.zeros(1), np.zeros(1)
        origins: list[NDArray[np.intp]] = []
        for layer, moves in zip(self._layers, self._offending(required), strict=True):
            steps = layer.lengths_m + SHIFT_COST * (layer.shifts_m - shifts_m[:, None]) ** 2
            steps[_blocked(layer, required)] = math.inf
            if not moves:
                steps[:, layer.shifts_m != 0.0] = math.inf
            total = cost[:, None] + steps
            origins.append(total.argmin(axis=0))
            cost = total.min(axis=0) + SHIFT_COST * layer.shifts_m**2
            shifts_m = layer.shifts_m
        return self._trace(cost, origins) if np.isfinite(cost).any() else None

    def _trace(self, cost: F64, origins: list[NDArray[np.intp]]) -> F64:
        choice = int(cost.argmin())
        chosen = []
        for layer, origin in zip(reversed(self._layers), reversed(origins), strict=True):
            chosen.append(layer.places[choice])
            choice = int(origin[choice])
        return np.array([self._path[0], *reversed(chosen)])

    def _offending(self, required_m: F64) -> list[bool]:
        """Which waypoints end or begin a piece that comes too near to a point."""
        pieces = [self._path[i : i + 2] for i in range(len(self._path) - 1)]
        bad = [bool((geometry.points_to_polyline_distance(p, self._points) < required_m).any()) for p in pieces]
        return [here or following for here, following in zip(bad, [*bad[1:], False], strict=True)]


def _blocked(layer: _Layer, required_m: F64) -> NDArray[np.bool_]:
    """Which pieces (a, b) come too near to a point."""
    too_near: NDArray[np.bool_] = layer.distance_m < required_m[layer.point_index] + SLACK_M
    return np.asarray(too_near.any(axis=2))


def _reachable(layer: _Layer, required_m: F64) -> _Layer:
    """The layer without the places that no free piece leads to."""
    reached = ~_blocked(layer, required_m).all(axis=0)
    return _Layer(
        layer.places[reached],
        layer.shifts_m[reached],
        layer.point_index,
        layer.distance_m[:, reached],
        layer.lengths_m[:, reached],
    )


def _layer(starts: F64, ends: F64, shifts_m: F64, points_ned_m: F64, reach_m: float) -> _Layer:
    """Pieces from every start (a, 2) to every end (b, 2)."""
    both = np.concatenate((starts, ends))
    low, high = both.min(axis=0) - reach_m, both.max(axis=0) + reach_m
    index = np.flatnonzero(((points_ned_m >= low) & (points_ned_m <= high)).all(axis=1))
    near = points_ned_m[index]
    step_n = ends[None, :, 0] - starts[:, None, 0]
    step_e = ends[None, :, 1] - starts[:, None, 1]
    squared = step_n * step_n + step_e * step_e
    inverse = 1.0 / np.where(squared > 0.0, squared, 1.0)
    from_n = near[:, 0] - starts[:, 0:1]  # (a, n)
    from_e = near[:, 1] - starts[:, 1:2]
    share = step_n[:, :, None] * from_n[:, None, :] + step_e[:, :, None] * from_e[:, None, :]
    share *= inverse[:, :, None]
    np.clip(share, 0.0, 1.0, out=share)
    off_n = from_n[:, None, :] - share * step_n[:, :, None]
    off_e = from_e[:, None, :] - share * step_e[:, :, None]
    off_n *= off_n
    off_e *= off_e
    off_n += off_e
    return _Layer(ends, shifts_m, index, np.sqrt(off_n, out=off_n), np.sqrt(squared))


def _normals(path_ned_m: F64) -> F64:
    """Unit normals (k, 2), to the right, of the waypoints after the start: across the chord of their neighbours."""
    following = np.concatenate((path_ned_m[2:], path_ned_m[-1:]))
    chords = following - path_ned_m[:-1]
    sizes = np.hypot(chords[:, 0], chords[:, 1])
    sizes[sizes == 0.0] = 1.0
    return np.stack((-chords[:, 1] / sizes, chords[:, 0] / sizes), axis=1)
