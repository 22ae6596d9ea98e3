"""May this polyline be flown as it is, corrected, not at all? The last gate before the vehicle; pure; local ned.

Nothing that fails the collision test is ever flown, whoever proposed it. The test is exact for a disc swept along the
polyline, so a path cannot slip between two points nearer than the disc is wide: neighbouring points of a wall count as
the wall. Depends on nothing learned.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from companion.checker.modify import Corrector
from companion.checker.params import CheckerParams
from companion.checker.score import score
from companion.core import geometry
from companion.core.types import F64

LEAST_LENGTH_M = 0.05  # a shorter polyline goes nowhere
CUT_SHORT_M = 0.02  # an escape ends this much before its first contact


class VerdictKind(StrEnum):
    """Every possible answer."""

    KEPT = "kept"
    NEXT = "next"  # not the proposal but one of the policy's next choices, as it is
    MODIFIED = "modified"
    ESCAPE = "escape"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True)
class CheckQuery:
    """A proposal and what it is judged against."""

    start_ned_m: F64  # (2,)
    start_vel_ned_m_s: F64  # (2,)
    goal_ned_m: F64  # (2,)
    radius_m: float  # hull of the vehicle
    points_ned_m: F64  # (n, 2) everything remembered
    proposal_ned_m: F64 | None  # (k, 2) waypoints; None: the policy has none
    escape_ned_m: F64 | None  # (k, 2) waypoints of a way out, tried only if the proposal cannot be saved
    others_ned_m: Sequence[F64] = ()  # next choices of the policy, each (k, 2), best first


@dataclass(frozen=True, slots=True)
class Verdict:
    """The answer; ``path_ned_m`` begins with the start and is None only if refused."""

    kind: VerdictKind
    path_ned_m: F64 | None  # (k + 1, 2)
    margin_m: float | None  # the declared level in force
    clearance_m: float | None  # hull to the nearest point along the path, at most clearance_full_m
    score: float | None
    keep_score: float | None  # None: fails the collision test at every level
    modify_score: float | None  # None: not needed, or no correction passes
    choice: int = 0  # which of the policy's choices was kept: 0 is the proposal, 1 the first of the others


@dataclass(frozen=True, slots=True)
class _Candidate:
    kind: VerdictKind
    path_ned_m: F64
    margin_m: float
    clearance_m: float
    score: float


REFUSAL = Verdict(VerdictKind.REFUSED, None, None, None, None, None, None)


def check(query: CheckQuery, params: CheckerParams) -> Verdict:
    """What may be flown; NaN anywhere in a path fails it.

    The proposal as it is at the full margin; else the first other choice that passes there; else the better of the
    proposal as it is and corrected, at a reduced margin; else another choice there; else the escape; else nothing.
    """
    if not np.isfinite(query.start_ned_m).all():
        return REFUSAL
    full = params.margins_m()[0]
    keep, modify, best = _keep(query, params), None, None
    choice = 0
    if keep is None or keep.margin_m < full:
        choice, best = _other(query, (full,), params)
        if best is None:
            modify = _modify(query, keep.margin_m if keep else -math.inf, params)
    if best is None:
        passing = [candidate for candidate in (keep, modify) if candidate is not None]
        best = max(passing, key=lambda candidate: candidate.score, default=None)
    if best is None:
        choice, best = _other(query, params.margins_m()[1:], params)
    best = best or _escape(query, params)
    if best is None:
        return REFUSAL
    return Verdict(
        best.kind,
        best.path_ned_m,
        best.margin_m,
        best.clearance_m,
        best.score,
        keep.score if keep else None,
        modify.score if modify else None,
        choice,
    )


def unchecked(query: CheckQuery, params: CheckerParams) -> Verdict:
    """The proposal as it is, tested against nothing: for measuring in simulation what the checker is worth.

    It counts as passed at the full margin, so that speed clamp and recheck in flight are those of any other path.
    """
    path = _path(query.start_ned_m, query.proposal_ned_m)
    return REFUSAL if path is None else Verdict(VerdictKind.KEPT, path, params.margins_m()[0], None, None, None, None)


def recheck(path_ned_m: F64, s_m: float, points_ned_m: F64, radius_m: float) -> bool:
    """Is the rest of an accepted path still free? ``radius_m`` from ``CheckerParams.recheck_radius_m``."""
    if not math.isfinite(s_m):
        return False
    rest = geometry.part(path_ned_m, s_m)
    return geometry.swept_free_length(rest, points_ned_m, radius_m) >= geometry.length(rest) - 1e-9


def _keep(query: CheckQuery, params: CheckerParams) -> _Candidate | None:
    """The proposal as it is, at the widest level it passes."""
    path = _path(query.start_ned_m, query.proposal_ned_m)
    if path is None:
        return None
    return _judge(VerdictKind.KEPT, path, query, params.margins_m(), params)


def _other(query: CheckQuery, margins_m: tuple[float, ...], params: CheckerParams) -> tuple[int, _Candidate | None]:
    """The policy's first next choice that passes as it is at one of the margins, and which one."""
    for choice, waypoints in enumerate(query.others_ned_m, start=1):
        path = _path(query.start_ned_m, waypoints)
        candidate = None if path is None else _judge(VerdictKind.NEXT, path, query, margins_m, params)
        if candidate is not None:
            return choice, candidate
    return 0, None


def _modify(query: CheckQuery, beyond_m: float, params: CheckerParams) -> _Candidate | None:
    """The proposal corrected, at the widest level beyond ``beyond_m`` for which there is a correction."""
    path = _path(query.start_ned_m, query.proposal_ned_m)
    if path is None:
        return None
    reach = params.shift_max_m + query.radius_m + params.margins_m()[0]
    near = geometry.points_near(path, query.points_ned_m, reach)
    corrector = Corrector(path, near, query.radius_m, params)
    for margin in params.margins_m():
        if margin <= beyond_m:
            return None
        corrected = corrector.correct(margin)
        if corrected is not None:
            return _judge(VerdictKind.MODIFIED, corrected, query, (margin,), params)
    return None


def _escape(query: CheckQuery, params: CheckerParams) -> _Candidate | None:
    """The way out, cut short of its first contact, at the widest level that leaves enough of it."""
    path = _path(query.start_ned_m, query.escape_ned_m)
    if path is None:
        return None
    whole = geometry.length(path)
    for margin in params.margins_m():
        free = geometry.swept_free_length(path, query.points_ned_m, query.radius_m + margin)
        cut = path if free >= whole else geometry.part(path, 0.0, free - CUT_SHORT_M)
        if geometry.length(cut) < min(params.escape_least_m, whole):
            continue
        candidate = _judge(VerdictKind.ESCAPE, cut, query, (margin,), params)
        if candidate is not None:
            return candidate
    return None


def _judge(
    kind: VerdictKind, path: F64, query: CheckQuery, margins_m: tuple[float, ...], params: CheckerParams
) -> _Candidate | None:
    """The collision test: the candidate at the first of the margins that it passes, None if it passes none."""
    radius = query.radius_m
    near = geometry.points_near(path, query.points_ned_m, radius + max(params.clearance_full_m, margins_m[0]))
    distance = geometry.points_to_polyline_distance(path, near)
    clearance = min(float(distance.min()) - radius if len(near) else math.inf, params.clearance_full_m)
    for margin in margins_m:
        required = geometry.required_distance(path[0], near, radius + margin, radius)
        if (distance >= required).all():
            value = score(path, query.start_vel_ned_m_s, query.goal_ned_m, clearance, params)
            return _Candidate(kind, path, margin, clearance, value)
    return None


def _path(start_ned_m: F64, waypoints_ned_m: F64 | None) -> F64 | None:
    """Start and waypoints as one polyline; None if absent, not finite or going nowhere."""
    if waypoints_ned_m is None:
        return None
    path = np.concatenate((start_ned_m[None, :], waypoints_ned_m))
    if not np.isfinite(path).all() or geometry.length(path) < LEAST_LENGTH_M:
        return None
    return path
