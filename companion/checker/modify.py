"""How far sideways must the offending waypoints go for the polyline to pass? Pure.

Only waypoints of pieces that come too near to a point move, each along the normal of the proposal, by one of a few
declared shares of ``shift_max_m``. The cheapest combination is found by dynamic programming from waypoint to waypoint;
cost = length + squared shift + squared difference of neighbouring shifts. Of two equal ones the right hand one wins.
"""

import math

import numpy as np
from numpy.typing import NDArray

from companion.checker.params import CheckerParams
from companion.core import geometry
from companion.core.types import F64

SHARES = np.array([0.0, 0.12, -0.12, 0.25, -0.25, 0.45, -0.45, 0.7, -0.7, 1.0, -1.0])  # of the farthest shift
SHIFT_COST = 1.0  # metres of length per squared metre of shift
SLACK_M = 1e-4  # kept beyond the requirement, so that rounding cannot spoil the final test


class Corrector:
    """The displaced versions of one proposal, prepared once and asked at every margin level."""

    def __init__(self, path_ned_m: F64, points_ned_m: F64, params: CheckerParams) -> None:
        """``path_ned_m`` (k + 1, 2) with the start first; offending pieces are judged at the widest margin."""
        self._path = path_ned_m
        self._radius_m = params.radius_m
        self._points = points_ned_m
        widest = self.required(params.margins_m()[0])
        self._widest = self._offending(widest)
        self._shifts_m = [SHARES * params.shift_max_m if moves else SHARES[:1] * 0.0 for moves in self._widest]
        normals = _normals(path_ned_m)
        places = [path_ned_m[i + 1] + self._shifts_m[i][:, None] * normals[i] for i in range(len(normals))]
        self._places = [path_ned_m[:1], *places]
        reach = params.radius_m + params.margins_m()[0]
        self._layers = [_layer(a, b, points_ned_m, reach) for a, b in zip(self._places, places, strict=False)]

    def required(self, margin_m: float) -> F64:
        """Distance (n,) to keep from each point at a margin level."""
        return geometry.required_distance(self._path[0], self._points, self._radius_m + margin_m, self._radius_m)

    def correct(self, margin_m: float) -> F64 | None:
        """The cheapest correction (k + 1, 2) that passes at the margin; None if there is none."""
        required = self.required(margin_m)
        moves = self._offending(required)
        cost: F64 = np.zeros(1)
        shifts: F64 = np.zeros(1)
        origins: list[NDArray[np.intp]] = []
        for i, layer in enumerate(self._layers):
            index, distance, lengths = layer
            steps = lengths + SHIFT_COST * (self._shifts_m[i] - shifts[:, None]) ** 2
            if len(index):
                blocked = (distance < required[index] + SLACK_M).any(axis=2)
                steps = np.where(blocked, math.inf, steps)
            if not moves[i]:
                steps[:, 1:] = math.inf
            total = cost[:, None] + steps
            origins.append(total.argmin(axis=0))
            cost = total.min(axis=0) + SHIFT_COST * self._shifts_m[i] ** 2
            shifts = self._shifts_m[i]
        return self._trace(cost, origins) if np.isfinite(cost).any() else None

    def _trace(self, cost: F64, origins: list[NDArray[np.intp]]) -> F64:
        choice = int(cost.argmin())
        chosen = []
        for places, origin in zip(reversed(self._places[1:]), reversed(origins), strict=True):
            chosen.append(places[choice])
            choice = int(origin[choice])
        return np.array([self._path[0], *reversed(chosen)])

    def _offending(self, required_m: F64) -> list[bool]:
        """Which waypoints end or begin a piece that comes too near to a point."""
        pieces = [self._path[i : i + 2] for i in range(len(self._path) - 1)]
        bad = [self._too_near(piece, required_m) for piece in pieces]
        return [here or following for here, following in zip(bad, [*bad[1:], False], strict=True)]

    def _too_near(self, piece: F64, required_m: F64) -> bool:
        if len(self._points) == 0:
            return False
        return bool((geometry.points_to_polyline_distance(piece, self._points) < required_m).any())


def _layer(starts: F64, ends: F64, points_ned_m: F64, reach_m: float) -> tuple[NDArray[np.intp], F64, F64]:
    """Pieces from every start (a, 2) to every end (b, 2).

    Indices (n,) of the points that matter, their distances (a, b, n) to each piece, lengths (a, b).
    """
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
    return index, np.sqrt(off_n, out=off_n), np.sqrt(squared)


def _normals(path_ned_m: F64) -> F64:
    """Unit normals (k, 2), to the right, of the waypoints after the start: across the chord of their neighbours."""
    following = np.concatenate((path_ned_m[2:], path_ned_m[-1:]))
    chords = following - path_ned_m[:-1]
    sizes = np.hypot(chords[:, 0], chords[:, 1])
    sizes[sizes == 0.0] = 1.0
    return np.stack((-chords[:, 1] / sizes, chords[:, 0] / sizes), axis=1)
