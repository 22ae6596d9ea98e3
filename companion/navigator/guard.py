"""Whose path is flown while the guard is on: the policy's, or that of the geometric expert? Pure; local NED.

The expert's proposal is one more candidate of the checker. The policy's is flown where the checker keeps it as it is,
with no less margin than the expert's, and where it is expected to be quicker: flown to its end, and from there straight
on to some place of the expert's own path, free of everything remembered. A policy that takes the wrong side of an
obstacle, or circles, is thus never followed; one that cuts a corner is. Only the expert's path counts, not its way
beyond: what has not been seen yet looks free from afar.

What a way takes is reckoned with the limits that hold in flight: slower beside obstacles, slower in corners.
"""

import math

import numpy as np

from companion.checker.checker import CheckQuery, Verdict, VerdictKind
from companion.core import geometry
from companion.core.types import F64
from companion.guidance.limits import LimitsParams

REJOIN_M = 1.0  # places of the expert's path that are tried, this far apart
FLOWN_AS_IS = (VerdictKind.KEPT, VerdictKind.NEXT)
STEP_M = 0.25  # between two places of a way whose clearance is looked at


def steps_in(policy: Verdict, guard: Verdict, asked: CheckQuery, pace: "Pace", ratio: float) -> bool:
    """Is the expert's path flown rather than the policy's?

    Args:
        policy: what the checker made of the policy's proposal.
        guard: what it made of the expert's.
        asked: what no path may touch, and how wide the vehicle is.
        pace: how fast what is flown.
        ratio: of the times that the two ways take, from which the expert's is flown.
    """
    if guard.path_ned_m is None or guard.margin_m is None or guard.kind is VerdictKind.ESCAPE:
        return False
    if policy.path_ned_m is None or policy.kind not in FLOWN_AS_IS or policy.margin_m is None:
        return True
    if policy.margin_m < guard.margin_m:
        return True
    radius_m = asked.radius_m + policy.margin_m
    rest = _rest_from(policy.path_ned_m[-1], guard.path_ned_m, asked.points_ned_m, radius_m)
    if rest is None:
        return True
    expert_s = pace.flight_s(guard.path_ned_m, guard.path_ned_m[-1:], asked)
    return pace.flight_s(policy.path_ned_m, rest, asked) > ratio * expert_s


class Pace:
    """How long a way takes, by the limits that hold in flight."""

    def __init__(self, cruise_m_s: float, limits: LimitsParams) -> None:
        self._cruise_m_s = cruise_m_s
        self._limits = limits

    def flight_s(self, path_ne_m: F64, rest_ne_m: F64, asked: CheckQuery) -> float:
        """Seconds along a path (k, 2) and the rest of the way (m, 2) that begins where the path ends."""
        whole = np.concatenate([path_ne_m, rest_ne_m[1:]])
        return self._along_s(whole, asked) + self._corners_s(np.concatenate([path_ne_m, rest_ne_m[1:2]]))

    def _along_s(self, way_ne_m: F64, asked: CheckQuery) -> float:
        """Slower beside obstacles, as ``limits.side_speed``."""
        places = geometry.resample(way_ne_m, STEP_M)
        full_m, slowest = self._limits.side_full_m, min(self._limits.side_min_m_s, self._cruise_m_s)
        near = geometry.points_near(way_ne_m, asked.points_ned_m, asked.radius_m + full_m)
        beside = np.ones(len(places))
        if len(near):
            away = places[:, None, :] - near[None, :, :]
            clearance = np.sqrt(np.einsum("ijk,ijk->ij", away, away).min(axis=1)) - asked.radius_m
            beside = np.clip(clearance / full_m, 0.0, 1.0)
        speed = slowest + (self._cruise_m_s - slowest) * beside
        steps = np.hypot(*np.diff(places, axis=0).T)
        return float((steps / np.minimum(speed[1:], speed[:-1])).sum())

    def _corners_s(self, path_ne_m: F64) -> float:
        """What braking for the corners and speeding up again costs."""
        legs = np.diff(path_ne_m, axis=0)
        length = np.hypot(legs[:, 0], legs[:, 1])
        legs, length = legs[length > 0.0], length[length > 0.0]
        if len(legs) < 2:
            return 0.0
        direction = legs / length[:, None]
        half = np.arccos(np.clip(np.einsum("ij,ij->i", direction[1:], direction[:-1]), -1.0, 1.0)) / 2.0
        half = np.clip(half, 1e-3, math.pi / 2.0 - 1e-3)
        limits = self._limits
        by_cut = limits.corner_cut_m / (1.0 / np.cos(half) - 1.0)
        radius = np.minimum(by_cut, np.minimum(length[1:], length[:-1]) / 2.0 / np.tan(half))
        corner = np.maximum(np.sqrt(limits.lateral_m_s2 * radius), limits.corner_min_m_s)
        lost = np.maximum(self._cruise_m_s - corner, 0.0)
        return float(
            (lost * lost).sum() * (1.0 / limits.brake_m_s2 + 1.0 / limits.rise_m_s2) / (2.0 * self._cruise_m_s)
        )


def _rest_from(end_ne_m: F64, way_ne_m: F64, points_ne_m: F64, radius_m: float) -> F64 | None:
    """Shortest way on from ``end`` over a place of the expert's path that it sees; None if it sees none."""
    whole = geometry.length(way_ne_m)
    best, best_s_m = math.inf, None
    for place, s_m in _places(way_ne_m, whole):
        step = math.dist(end_ne_m.tolist(), place.tolist())
        if step + whole - s_m >= best:
            continue
        leg = np.stack([end_ne_m, place])
        if step < 1e-6 or geometry.swept_free_length(leg, points_ne_m, radius_m) >= step - 1e-6:
            best, best_s_m = step + whole - s_m, s_m
    return None if best_s_m is None else np.concatenate([end_ne_m[None], geometry.part(way_ne_m, best_s_m)])


def _places(way_ne_m: F64, whole_m: float) -> list[tuple[F64, float]]:
    """Places of a path, the last first, and how far along they are."""
    count = max(1, math.ceil(whole_m / REJOIN_M))
    steps = [whole_m * k / count for k in range(count, -1, -1)]
    return [(geometry.point_at(way_ne_m, s_m), s_m) for s_m in steps]
