"""What moves, and where will it be? Tracks of hits inside space that was just proven free; pure; local NED.

The map already knows: an arc whose every cell was certified free lately can only be something that came. Those hits are
clustered and followed by an alpha-beta filter; once a track has really travelled, the discs that it will sweep within
the look-ahead are hazards for planner, checker and clamp. Nothing is said of what stands still: that is the map's.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.params import param
from companion.core.types import F64

MAX_STEP_S = 0.2  # a longer gap between scans tells no velocity
RING = np.array([[0.0, 0.0]] + [[math.cos(a), math.sin(a)] for a in np.arange(6) * (math.tau / 6)])


@dataclass(frozen=True, slots=True)
class MoverParams:
    """Tracking of what moves."""

    ahead_s: float = param(2.5, "SN_MV_AHEAD", "Look-ahead of the swept discs (0: movers are not predicted)", "s", 0, 5)
    steps: int = param(9, "SN_MV_STEPS", "Discs along the look-ahead", "", 1, 30)
    radius_m: float = param(0.4, "SN_MV_RADIUS", "Radius assumed of what moves", "m", 0.05, 2.0)
    room_m: float = param(0.2, "SN_MV_ROOM", "A disc nearer to the hull than this is left, not stopped for", "m", 0, 2)
    gate_m: float = param(0.8, "SN_MV_GATE", "A cluster farther from a track than this is another one", "m", 0.1, 3.0)
    link_m: float = param(0.7, "SN_MV_LINK", "Hits nearer together than this are one cluster", "m", 0.1, 3.0)
    range_m: float = param(10.0, "SN_MV_RANGE", "Hits beyond this are not tracked", "m", 1.0, 40.0)
    travel_m: float = param(0.3, "SN_MV_TRAVEL", "A track counts once it has travelled this far", "m", 0.05, 3.0)
    hits: int = param(6, "SN_MV_HITS", "and was seen in this many scans", "", 2, 100)
    slow_m_s: float = param(0.3, "SN_MV_SLOW", "and moves faster than this", "m/s", 0.0, 3.0)
    coast_s: float = param(0.8, "SN_MV_COAST", "A track not seen for this long is dropped", "s", 0.1, 5.0)
    again_m: float = param(
        0.0, "SN_MV_AGAIN", "Tracks are found again in all hits so near (0: where space was free)", "m", 0, 3
    )
    split_m: float = param(0.35, "SN_MV_SPLIT", "Then neighbouring hits farther apart are two things", "m", 0.05, 3.0)
    settled: int = param(12, "SN_MV_SETTLED", "In so many scans its velocity has become known", "", 2, 100)
    doubt_m_s: float = param(0.3, "SN_MV_DOUBT", "How far off a known velocity may be", "m/s", 0.0, 3.0)
    unknown_m_s: float = param(1.0, "SN_MV_UNKNOWN", "How far off it may be before", "m/s", 0.0, 5.0)
    fast_m_s: float = param(2.0, "SN_MV_FAST", "Nothing moves faster", "m/s", 0.1, 20.0)
    gain_pos: float = param(0.35, "SN_MV_GAIN_P", "alpha of the filter", "", 0.01, 1.0)
    gain_vel: float = param(0.07, "SN_MV_GAIN_V", "beta of the filter", "", 0.001, 1.0)


@dataclass(frozen=True, slots=True)
class Track:
    """One thing that moves."""

    pos_ne_m: F64  # (2,) centre
    vel_ne_m_s: F64  # (2,)
    origin_ne_m: F64  # (2,) where it was first seen
    seen_t_s: float
    hits: int


def follow(
    tracks: tuple[Track, ...], moved_ne_m: F64, pos_ne_m: F64, t_s: float, dt_s: float, params: MoverParams
) -> tuple[Track, ...]:
    """The tracks after one more scan.

    Args:
        tracks: of the scan before.
        moved_ne_m: (m, 2) hits of this scan inside space that was certified free.
        pos_ne_m: (2,) of the vehicle.
        t_s: of this scan.
        dt_s: since the scan before.
        params: tunables.
    """
    step_s = min(max(dt_s, 0.0), MAX_STEP_S)
    coasting = [replace(t, pos_ne_m=t.pos_ne_m + t.vel_ne_m_s * step_s) for t in tracks]
    coasting = [t for t in coasting if t_s - t.seen_t_s <= params.coast_s]
    for centre in centres_of(moved_ne_m, pos_ne_m, params):
        nearest = min(range(len(coasting)), key=lambda i: distance(coasting[i].pos_ne_m, centre), default=None)
        if nearest is None or distance(coasting[nearest].pos_ne_m, centre) > params.gate_m:
            coasting.append(Track(centre, np.zeros(2), centre, t_s, 1))
        elif coasting[nearest].seen_t_s < t_s:
            coasting[nearest] = _corrected(coasting[nearest], centre, t_s, step_s, params)
    return tuple(coasting)


def moving(track: Track, params: MoverParams) -> bool:
    """Has it really travelled, long and fast enough to believe its velocity?"""
    return (
        track.hits >= params.hits
        and distance(track.pos_ne_m, track.origin_ne_m) >= params.travel_m
        and math.hypot(track.vel_ne_m_s[0], track.vel_ne_m_s[1]) >= params.slow_m_s
    )


def hazards(tracks: tuple[Track, ...], params: MoverParams) -> F64:
    """(d, 2) centres of the discs that moving things will sweep within the look-ahead, nearest in time first."""
    movers = [t for t in tracks if moving(t, params)] if params.ahead_s > 0.0 else []
    if not movers:
        return np.empty((0, 2))
    ahead = np.linspace(0.0, params.ahead_s, params.steps)[:, None]
    return np.concatenate([t.pos_ne_m + ahead * t.vel_ne_m_s for t in movers])


def discs(centres_ne_m: F64, params: MoverParams) -> F64:
    """(7 d, 2) points in the middle and on the rim of each disc."""
    points: F64 = (centres_ne_m[:, None, :] + params.radius_m * RING).reshape(-1, 2)
    return points


def avoidable(centres_ne_m: F64, pos_ne_m: F64, radius_m: float, params: MoverParams) -> F64:
    """The discs that do not hold the vehicle already: from within one, any way out is better than standing still."""
    offset = centres_ne_m - pos_ne_m
    outside: F64 = centres_ne_m[np.hypot(offset[:, 0], offset[:, 1]) > params.radius_m + radius_m + params.room_m]
    return outside


def centres_of(moved_ne_m: F64, pos_ne_m: F64, params: MoverParams) -> list[F64]:
    """Centres of the clusters: a radius behind the visible surface."""
    clusters: list[list[F64]] = []
    for point in moved_ne_m:
        if distance(point, pos_ne_m) > params.range_m:
            continue
        home = next((c for c in clusters if distance(c[-1], point) <= params.link_m), None)
        if home is None:
            clusters.append([point])
        else:
            home.append(point)
    surfaces = [np.mean(cluster, axis=0) for cluster in clusters]
    return [s + (s - pos_ne_m) * (params.radius_m / max(distance(s, pos_ne_m), 1e-6)) for s in surfaces]


def _corrected(track: Track, centre: F64, t_s: float, step_s: float, params: MoverParams) -> Track:
    residual = centre - track.pos_ne_m
    gain_vel = params.gain_vel / step_s if step_s > 0.0 else 0.0
    return Track(
        track.pos_ne_m + params.gain_pos * residual,
        track.vel_ne_m_s + gain_vel * residual,
        track.origin_ne_m,
        t_s,
        track.hits + 1,
    )


def distance(a: F64, b: F64) -> float:
    """Between two places."""
    return math.hypot(float(a[0] - b[0]), float(a[1] - b[1]))
