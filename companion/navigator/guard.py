"""Whose path is flown while the guard is on: the policy's, or that of the geometric expert? Pure; local NED.

The expert's proposal is one more candidate of the checker. The policy's is flown where the checker keeps it as it is
and where it begins no worse than the expert's by the expert's own way to the goal: flown to its end, and from there
straight on to some later place of that way, free of everything remembered, it takes hardly more. A policy that takes
the wrong side of an obstacle, or circles, is thus never followed; one that cuts a corner is.
"""

import math

import numpy as np

from companion.checker.checker import CheckQuery, Verdict, VerdictKind
from companion.core import geometry
from companion.core.types import F64

REJOIN_M = 1.0  # places of the expert's way that are tried, this far apart


def steps_in(policy: Verdict, guard: Verdict, way_ne_m: F64 | None, asked: CheckQuery, ratio: float) -> bool:
    """Is the expert's path flown rather than the policy's?

    Args:
        policy: what the checker made of the policy's proposal.
        guard: what it made of the expert's.
        way_ne_m: (k, 2) the expert's whole way, from the anchor on; None: it has none.
        asked: what no path may touch, and how wide the vehicle is.
        ratio: of the lengths of the two ways, from which the expert's is flown.
    """
    if guard.path_ned_m is None or way_ne_m is None or guard.kind is VerdictKind.ESCAPE:
        return False
    if policy.path_ned_m is None or policy.kind is not VerdictKind.KEPT or policy.margin_m is None:
        return True
    flown_m = geometry.length(policy.path_ned_m)
    left_m = _rest_from(policy.path_ned_m[-1], way_ne_m, asked.points_ned_m, asked.radius_m + policy.margin_m)
    return flown_m + left_m > ratio * _whole(guard.path_ned_m, way_ne_m)


def _whole(path_ne_m: F64, way_ne_m: F64) -> float:
    """Length of the expert's way from the beginning of its path, which leads along the committed stretch first."""
    at = geometry.project(way_ne_m, path_ne_m[-1])
    return geometry.length(path_ne_m) + geometry.length(way_ne_m) - at.s_m


def _rest_from(end_ne_m: F64, way_ne_m: F64, points_ne_m: F64, radius_m: float) -> float:
    """Shortest way on from ``end`` over a place of the expert's way that it sees; inf if it sees none."""
    whole = geometry.length(way_ne_m)
    best = math.inf
    for place, s_m in _places(way_ne_m, whole):
        step = math.dist(end_ne_m.tolist(), place.tolist())
        if step + whole - s_m >= best:
            continue
        leg = np.stack([end_ne_m, place])
        if step < 1e-6 or geometry.swept_free_length(leg, points_ne_m, radius_m) >= step - 1e-6:
            best = step + whole - s_m
    return best


def _places(way_ne_m: F64, whole_m: float) -> list[tuple[F64, float]]:
    """Places of the way, the last first, and how far along they are."""
    count = max(1, math.ceil(whole_m / REJOIN_M))
    steps = [whole_m * k / count for k in range(count, -1, -1)]
    return [(geometry.point_at(way_ne_m, s_m), s_m) for s_m in steps]
