"""How far along a polyline, how far from it, and how far can a disc follow it before it touches a point?

Plane geometry in (north, east) metres, pure. Polylines are (k, 2) arrays, k >= 1; repeated vertices are allowed. Few
vertices are walked in plain floats (a tick has no time for many tiny arrays); many points are handled as arrays of
complex numbers, north + i east: one product turns them all into the frame of a piece.
"""

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64

NEARER_M = 0.01  # a point already inside the radius at the start counts once the path comes this much nearer


class Projection(NamedTuple):
    """Where a position is with respect to a polyline."""

    s_m: float  # arc length of the nearest point
    lateral_m: float  # signed offset, right of the direction of travel is positive
    distance_m: float  # to the nearest point


class Segment(NamedTuple):
    """One straight piece of a polyline: start, unit direction, length, arc length at its start."""

    north_m: float
    east_m: float
    dir_north: float
    dir_east: float
    length_m: float
    s_m: float


def segments(path_ned_m: F64) -> tuple[Segment, ...]:
    """The pieces of positive length, in order; empty for a polyline that is a single place.

    A tick asks much about few polylines: the pieces of those asked about last are kept.
    """
    return _cut(path_ned_m).pieces


def arc_lengths(path_ned_m: F64) -> F64:
    """Arc length (k,) of each vertex."""
    steps = [math.dist(here, there) for here, there in itertools.pairwise(path_ned_m.tolist())]
    return np.array([0.0, *itertools.accumulate(steps)])


def length(path_ned_m: F64) -> float:
    """Length of the whole polyline."""
    pieces = segments(path_ned_m)
    return pieces[-1].s_m + pieces[-1].length_m if pieces else 0.0


def project(path_ned_m: F64, pos_ned_m: F64, s_min_m: float = 0.0, s_max_m: float = math.inf) -> Projection:
    """Nearest place of the polyline with arc length in [s_min_m, s_max_m]; the first of equally near ones."""
    north, east = float(pos_ned_m[0]), float(pos_ned_m[1])
    pieces = segments(path_ned_m)
    if not pieces:
        return Projection(0.0, 0.0, math.hypot(north - float(path_ned_m[0, 0]), east - float(path_ned_m[0, 1])))
    end_s = pieces[-1].s_m + pieces[-1].length_m
    low, high = min(max(s_min_m, 0.0), end_s), min(max(s_max_m, s_min_m, 0.0), end_s)
    best = Projection(low, math.nan, math.inf)
    for piece in pieces:
        first, last = max(low - piece.s_m, 0.0), min(high - piece.s_m, piece.length_m)
        if piece is pieces[-1]:
            first = min(first, last)  # rounding must not put the end beyond the end
        if first > last:
            continue
        dn, de = north - piece.north_m, east - piece.east_m
        along = min(max(dn * piece.dir_north + de * piece.dir_east, first), last)
        distance = math.hypot(dn - along * piece.dir_north, de - along * piece.dir_east)
        if distance < best.distance_m:
            lateral = piece.dir_north * de - piece.dir_east * dn
            best = Projection(piece.s_m + along, lateral, distance)
    return best


def point_at(path_ned_m: F64, s_m: float) -> F64:
    """The place (2,) at arc length s_m; the ends beyond the ends."""
    pieces = segments(path_ned_m)
    return np.array(place_at(pieces, s_m) if pieces else path_ned_m[0], dtype=np.float64)


def tangent_at(path_ned_m: F64, s_m: float) -> F64:
    """Unit direction (2,) at arc length s_m, at a vertex that of the piece ahead; zeros for a single place."""
    piece = segment_at(segments(path_ned_m), s_m)
    return np.zeros(2) if piece is None else np.array([piece.dir_north, piece.dir_east])


def segment_at(pieces: Sequence[Segment], s_m: float) -> Segment | None:
    """The piece that holds arc length s_m, the first or last one beyond the ends; None if there is none."""
    found: Segment | None = None
    for piece in pieces:
        if found is not None and piece.s_m > s_m:
            break
        found = piece
    return found


def place_at(pieces: Sequence[Segment], s_m: float) -> tuple[float, float]:
    """North and east at arc length s_m; the ends beyond the ends. There must be a piece."""
    piece = segment_at(pieces, s_m) or pieces[0]
    along = min(max(s_m - piece.s_m, 0.0), piece.length_m)
    return piece.north_m + along * piece.dir_north, piece.east_m + along * piece.dir_east


def part(path_ned_m: F64, s_from_m: float, s_to_m: float = math.inf) -> F64:
    """The polyline between two arc lengths, both clamped to its ends; at least one vertex."""
    pieces = segments(path_ned_m)
    if not pieces:
        return np.array(path_ned_m[:1], dtype=np.float64)
    end_s = pieces[-1].s_m + pieces[-1].length_m
    low = min(max(s_from_m, 0.0), end_s)
    high = min(max(s_to_m, low), end_s)
    vertices = [place_at(pieces, low)]
    if high > low:
        vertices += [(piece.north_m, piece.east_m) for piece in pieces if low < piece.s_m < high]
        vertices.append(place_at(pieces, high))
    return np.array(vertices)


def extended(path_ned_m: F64, by_m: float) -> F64:
    """The polyline with its last piece made longer; itself where there is no piece or nothing to add."""
    pieces = segments(path_ned_m)
    if not pieces or not by_m > 0.0:
        return path_ned_m
    last = pieces[-1]
    longer = np.array(path_ned_m, dtype=np.float64)
    longer[-1] += by_m * np.array([last.dir_north, last.dir_east])
    return longer


def resample(path_ned_m: F64, spacing_m: float) -> F64:
    """Vertices at equal arc length, not farther apart than spacing_m; first and last vertex kept."""
    s = arc_lengths(path_ned_m)
    whole = float(s[-1])
    count = max(1, math.ceil(whole / spacing_m - 1e-9))
    at = np.arange(count + 1) * (whole / count)
    at[-1] = whole
    places = np.empty((count + 1, 2))
    places[:, 0] = np.interp(at, s, path_ned_m[:, 0])
    places[:, 1] = np.interp(at, s, path_ned_m[:, 1])
    return places


def points_near(path_ned_m: F64, points_ned_m: F64, reach_m: float) -> F64:
    """The points inside the bounding box of the polyline grown by reach_m: every point within reach_m is among them."""
    if len(points_ned_m) == 0:
        return points_ned_m
    norths, easts = path_ned_m.T.tolist()
    north, east = points_ned_m[:, 0], points_ned_m[:, 1]
    inside = (north >= min(norths) - reach_m) & (north <= max(norths) + reach_m)
    inside &= (east >= min(easts) - reach_m) & (east <= max(easts) + reach_m)
    near: F64 = points_ned_m.compress(inside, axis=0)
    return near


def points_to_polyline_distance(path_ned_m: F64, points_ned_m: F64) -> F64:
    """Distance (n,) of each point to the polyline."""
    cut = _cut(path_ned_m)
    if not cut.pieces:
        alone: F64 = np.hypot(points_ned_m[:, 0] - path_ned_m[0, 0], points_ned_m[:, 1] - path_ned_m[0, 1])
        return alone
    along, lateral = _in_segments(cut, points_ned_m)
    beyond = along - np.minimum(np.maximum(along, 0.0), cut.length_m)
    distance: F64 = np.sqrt((beyond * beyond + lateral * lateral).min(axis=0))
    return distance


def nearest_distance(path_ned_m: F64, points_ned_m: F64, reach_m: float = math.inf) -> float:
    """Distance from the polyline to the nearest point; inf if none is within reach_m."""
    near = points_near(path_ned_m, points_ned_m, reach_m) if reach_m < math.inf else points_ned_m
    if len(near) == 0:
        return math.inf
    nearest = float(points_to_polyline_distance(path_ned_m, near).min())
    return nearest if nearest <= reach_m else math.inf


def shortened(north: float, east: float, most: float) -> tuple[float, float]:
    """The vector, no longer than ``most``; zero if it is not finite."""
    size = math.hypot(north, east)
    if not 0.0 < size < math.inf:
        return 0.0, 0.0
    share = min(1.0, most / size)
    return north * share, east * share


def required_distance(start_ned_m: F64, points_ned_m: F64, radius_m: float, floor_m: float = 0.0) -> F64:
    """Distance (n,) that a disc leaving ``start`` must keep from each point.

    The radius; less for points that are inside it already: they must not come nearer by ``NEARER_M``. Down to
    ``floor_m`` that centimetre is given; a point inside the floor may only get farther away.
    """
    now: F64 = np.hypot(points_ned_m[:, 0] - start_ned_m[0], points_ned_m[:, 1] - start_ned_m[1])
    given = np.maximum(now - NEARER_M, np.minimum(floor_m, now - 1e-6))
    required: F64 = np.minimum(radius_m, np.maximum(given, 0.0))
    return required


def swept_free_length(
    path_ned_m: F64, points_ned_m: F64, radius_m: float, s_m: float = 0.0, horizon_m: float = math.inf
) -> float:
    """How far beyond arc length s_m a disc follows the polyline until it touches a point.

    Returns the remaining length (at most horizon_m) if it touches none. Touching is a distance below radius_m; see
    ``required_distance`` for points that are inside the radius at s_m already.
    """
    ahead = part(path_ned_m, s_m, s_m + horizon_m) if s_m > 0.0 or horizon_m < math.inf else path_ned_m
    cut = _cut(ahead)
    if not cut.pieces:
        return 0.0
    whole = cut.pieces[-1].s_m + cut.pieces[-1].length_m
    near = points_near(ahead, points_ned_m, radius_m) if len(cut.pieces) > 1 else points_ned_m
    brushed = _brushed(cut, near, radius_m)
    if len(brushed) == 0:
        return whole
    return min(whole, _first_contact(cut, brushed, required_distance(ahead[0], brushed, radius_m)))


def _brushed(cut: "_Cut", points_ned_m: F64, reach_m: float) -> F64:
    """The points in a rectangle round one of the pieces: every point within reach_m is among them."""
    along, lateral = _in_segments(cut, points_ned_m)
    inside = (np.abs(lateral) < reach_m) & (np.abs(along - cut.half_m) < cut.half_m + reach_m)
    brushed: F64 = points_ned_m.compress(np.logical_or.reduce(inside), axis=0)
    return brushed


def _first_contact(cut: "_Cut", points_ned_m: F64, required_m: F64) -> float:
    """Smallest arc length at which a point is nearer than required; inf if none ever is."""
    along, lateral = _in_segments(cut, points_ned_m)
    chord = required_m * required_m - lateral * lateral
    half = np.sqrt(np.maximum(chord, 0.0))
    begin = along - half
    touched = (chord > 0.0) & (along + half > 0.0) & (begin < cut.length_m)
    if not touched.any():
        return math.inf
    entry: F64 = cut.s_m + np.maximum(begin, 0.0)
    return float(entry[touched].min())


def _in_segments(cut: "_Cut", points_ned_m: F64) -> tuple[F64, F64]:
    """Coordinates (m, n) of every point along and right of every piece."""
    points = np.ascontiguousarray(points_ned_m, np.float64).view(np.complex128)[:, 0]
    turned = (points - cut.start) * cut.back
    return turned.real, turned.imag


class _Cut(NamedTuple):
    """A polyline in pieces, and the same as columns (m, 1)."""

    pieces: tuple[Segment, ...]
    start: NDArray[np.complex128]
    back: NDArray[np.complex128]  # direction, conjugate: turns it to 1
    length_m: F64
    half_m: F64
    s_m: F64


def _cut(path_ned_m: F64) -> _Cut:
    return _cut_of(np.asarray(path_ned_m, np.float64).tobytes())


@lru_cache(maxsize=64)
def _cut_of(vertices: bytes) -> _Cut:
    pieces: list[Segment] = []
    columns: list[float] = []  # as complex numbers: one array is quicker than five
    s = 0.0
    (north, east), *others = np.frombuffer(vertices).reshape(-1, 2).tolist()
    for next_north, next_east in others:
        dn, de = next_north - north, next_east - east
        length = math.hypot(dn, de)
        if length > 0.0:
            dn, de = dn / length, de / length
            pieces.append(Segment(north, east, dn, de, length, s))
            columns += (north, east, dn, -de, length, 0.0, length / 2.0, 0.0, s, 0.0)
            s += length
            north, east = next_north, next_east
    start, back, lengths, halves, starts = np.array(columns).view(np.complex128).reshape(-1, 5, 1).swapaxes(0, 1)
    return _Cut(tuple(pieces), start, back, lengths.real, halves.real, starts.real)
