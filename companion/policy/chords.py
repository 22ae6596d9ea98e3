"""Which five waypoints say a path? Chords that stay near it; pure; (north, east) m."""

import math

import numpy as np

from companion.core.types import F64
from companion.policy.interface import WAYPOINTS

CHORD_POINTS = 20  # of the path that one chord replaces, at most


def chords(path: F64, tolerance_m: float, length_m: float) -> F64:
    """At most five places (k, 2) of a path (n, 2), greedily: each chord as long as the path stays near it.

    Args:
        path: in steps short enough for chords to follow, the first place left out of the answer.
        tolerance_m: how far the path may leave a chord.
        length_m: no chord begins beyond this.
    """
    picked: list[int] = []
    at, used = 0, 0.0
    while at < len(path) - 1 and len(picked) < WAYPOINTS and used < length_m:
        end = at + _chord(path[at : at + CHORD_POINTS + 1], tolerance_m)
        used += math.dist(path[at].tolist(), path[end].tolist())
        picked.append(end)
        at = end
    return path[picked]


def _chord(path: F64, tolerance_m: float) -> int:
    """Last place of a stretch up to which every chord from its beginning stays within the tolerance; at least 1."""
    if len(path) <= 2:
        return 1
    dn, de = path[1:, 0] - path[0, 0], path[1:, 1] - path[0, 1]
    off_m2 = np.abs(dn[None, :] * de[:, None] - de[None, :] * dn[:, None])  # chord to each place, and each place
    chord_m = np.array([math.hypot(*end) for end in zip(dn.tolist(), de.tolist(), strict=True)])
    most_m2 = np.tril(off_m2).max(axis=1)  # of the places before the chord's end
    within = (chord_m >= 1e-9) & (most_m2 / np.maximum(chord_m, 1e-9) <= tolerance_m)
    within[0] = True
    return len(within) if within.all() else int(within.argmin())
