"""What could come at the vehicle, and how sure is that? Tracks found again in all that is seen; pure; local NED.

``movers.follow`` believes only what lies where space was just proven free: sure that it moves, but slow to learn its
velocity, and blind where a mover passes by something else. Here a track that began so is found again among everything
that is seen and narrow enough; a young one learns by the gains of a growing memory, an old one by the filter's own.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.types import F64
from companion.perception.movers import MAX_STEP_S, MoverParams, Track, centres_of, distance

WIDE = 3.0  # radii assumed of what moves: what looks wider is no such thing
SAME_M = 0.3  # two tracks nearer together are one
TURNED_M = 0.25  # so far off where it should be, a track has turned: it learns anew
YOUNG = 6  # scans, from then on
LATELY_S = 0.4  # what was seen longer ago is not reckoned with
STANDS_M_S = 0.15  # slower, once that is known, it stands
OWN_HITS_M = 0.3  # hits nearer to its disc than this are its own


@dataclass(frozen=True, slots=True)
class Threats:
    """What moves, or may."""

    pos_ne_m: F64  # (m, 2) centres
    vel_ne_m_s: F64  # (m, 2)
    doubt_m_s: F64  # (m,) how far off that may be
    static_ne_m: F64  # (k, 2) hits that are none of theirs


def follow_seen(
    tracks: tuple[Track, ...],
    moved_ne_m: F64,
    hits_ne_m: F64,
    pos_ne_m: F64,
    t_s: float,
    dt_s: float,
    params: MoverParams,
) -> tuple[Track, ...]:
    """The tracks after one more scan.

    Args:
        tracks: of the scan before.
        moved_ne_m: (m, 2) hits of this scan inside space that was certified free: where tracks begin.
        hits_ne_m: (h, 2) all hits of this scan, in the order of their bearings.
        pos_ne_m: (2,) of the vehicle.
        t_s: of this scan.
        dt_s: since the scan before.
        params: tunables.
    """
    step_s = min(max(dt_s, 0.0), MAX_STEP_S)
    coasting = [replace(t, pos_ne_m=t.pos_ne_m + t.vel_ne_m_s * step_s) for t in tracks]
    coasting = [t for t in coasting if t_s - t.seen_t_s <= params.coast_s]
    seen = narrow(hits_ne_m, pos_ne_m, params)
    kept: list[Track] = []
    for track in sorted(coasting, key=lambda track: -track.hits):  # the best known chooses first
        if any(distance(track.pos_ne_m, other.pos_ne_m) < SAME_M for other in kept):
            continue
        away = np.hypot(*(seen - track.pos_ne_m).T)
        if len(away) and away.min() <= params.again_m and track.seen_t_s < t_s:
            nearest = int(np.argmin(away))
            track = _learned(track, seen[nearest], t_s, step_s, params)
            seen = np.delete(seen, nearest, axis=0)
        kept.append(track)
    for centre in centres_of(moved_ne_m, pos_ne_m, params):
        if all(distance(track.pos_ne_m, centre) > params.gate_m for track in kept):
            kept.append(Track(centre, np.zeros(2), centre, t_s, 1))
    return tuple(kept)


def threats(tracks: tuple[Track, ...], hits_ne_m: F64, t_s: float, params: MoverParams) -> Threats:
    """Every track that was seen lately and is not known to stand; before its velocity is known, much doubt."""
    kept = [t for t in tracks if t.hits >= 2 and t_s - t.seen_t_s <= LATELY_S]
    kept = [t for t in kept if t.hits < params.settled or math.hypot(*t.vel_ne_m_s) > STANDS_M_S]
    pos = np.array([t.pos_ne_m for t in kept]).reshape(-1, 2)
    vel = np.array([t.vel_ne_m_s for t in kept]).reshape(-1, 2)
    doubt = np.array([params.doubt_m_s if t.hits >= params.settled else params.unknown_m_s for t in kept])
    if len(kept) and len(hits_ne_m):
        away = np.sqrt(((hits_ne_m[:, None] - pos) ** 2).sum(axis=2)).min(axis=1)
        hits_ne_m = hits_ne_m.compress(away > params.radius_m + OWN_HITS_M, axis=0)
    return Threats(pos, vel, doubt, hits_ne_m)


def narrow(hits_ne_m: F64, pos_ne_m: F64, params: MoverParams) -> F64:
    """(c, 2) centres of what is seen and is no wider than what moves may be: a radius behind the visible surface."""
    gap = np.hypot(*(np.roll(hits_ne_m, -1, axis=0) - hits_ne_m).T) > params.split_m
    if not gap.any():
        return np.empty((0, 2))
    begin = int(np.argmax(gap)) + 1  # the first hit of a thing
    hits, ends = np.roll(hits_ne_m, -begin, axis=0), np.roll(gap, -begin)
    last = np.flatnonzero(ends)
    first = np.concatenate([[0], last[:-1] + 1])
    middle = np.add.reduceat(hits, first, axis=0) / (last - first + 1)[:, None]
    width = np.hypot(*(hits[last] - hits[first]).T)
    offset = middle - pos_ne_m
    away = np.hypot(*offset.T)
    keep = (width <= WIDE * params.radius_m) & (away <= params.range_m)
    centres: F64 = middle + offset * (params.radius_m / np.maximum(away, 1e-6))[:, None]
    return centres.compress(keep, axis=0)


def _learned(track: Track, centre: F64, t_s: float, step_s: float, params: MoverParams) -> Track:
    residual = centre - track.pos_ne_m
    n = min(track.hits + 1, YOUNG) if math.hypot(*residual) > TURNED_M else track.hits + 1
    gain_pos = min(max(params.gain_pos, 2.0 * (2 * n - 1) / (n * (n + 1))), 1.0)
    gain_vel = max(params.gain_vel, 6.0 / (n * (n + 1))) / step_s if step_s > 0.0 else 0.0
    vel = track.vel_ne_m_s + gain_vel * residual
    vel = vel * min(1.0, params.fast_m_s / max(math.hypot(*vel), 1e-9))
    return Track(track.pos_ne_m + gain_pos * residual, vel, track.origin_ne_m, t_s, n)
