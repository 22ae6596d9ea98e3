import dataclasses
import itertools
import math

import fcl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.checker.checker import CheckQuery, Verdict, VerdictKind, check, recheck
from companion.checker.params import CheckerParams
from companion.checker.score import progress_ratio, score, turning_rad
from companion.core import geometry
from companion.core.types import F64

PARAMS = CheckerParams()
RADIUS_M = 0.33
GRAIN_M = 1e-5
MIRROR = np.array([1.0, -1.0])
STRAIGHT = np.array([[0.8, 0.0], [1.6, 0.0], [2.4, 0.0], [3.2, 0.0], [4.0, 0.0]])
COORDINATE = st.floats(-4.0, 6.0).map(lambda x: round(x, 3))
TREES = st.lists(st.tuples(COORDINATE, COORDINATE, st.floats(0.05, 0.5)), min_size=0, max_size=12)
STEPS = st.lists(st.tuples(st.floats(0.3, 1.2), st.floats(-0.8, 0.8)), min_size=5, max_size=5)


def tree(north_m: float, east_m: float, radius_m: float = 0.3, count: int = 24) -> F64:
    around = np.arange(count) * math.tau / count
    return np.array([north_m, east_m]) + radius_m * np.stack((np.cos(around), np.sin(around)), axis=1)


def wall(north_m: float, low_m: float, high_m: float) -> F64:
    east = np.arange(low_m, high_m + 1e-9, 0.1)
    return np.stack((np.full(len(east), north_m), east), axis=1)


def query(points: F64, proposal: F64 | None = STRAIGHT, escape: F64 | None = None) -> CheckQuery:
    return CheckQuery(np.zeros(2), np.zeros(2), np.array([20.0, 0.0]), RADIUS_M, points, proposal, escape)


def scene(trees: list[tuple[float, float, float]]) -> F64:
    """Points of trees that do not stand on the vehicle."""
    free = [tree(n, e, r, 16) for n, e, r in trees if math.hypot(n, e) > r + RADIUS_M + 0.01]
    return np.concatenate([np.zeros((0, 2)), *free])


def waypoints(steps: list[tuple[float, float]]) -> F64:
    courses = np.cumsum([turn for _, turn in steps])
    lengths = np.array([length for length, _ in steps])
    return np.cumsum(lengths[:, None] * np.stack((np.cos(courses), np.sin(courses)), axis=1), axis=0)


def oracle_clear(path: F64, points: F64, radius_m: float) -> bool:
    """Does FCL find the area swept by a disc free of points?"""
    grains = [fcl.CollisionObject(fcl.Sphere(GRAIN_M), fcl.Transform(np.array([*p, 0.0]))) for p in points]
    for a, b in itertools.pairwise(path):
        length = math.dist(a, b)
        axis = np.array([*(b - a), 0.0]) / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
        side = np.array([-axis[1], axis[0], 0.0])
        pose = fcl.Transform(np.stack([side, np.cross(axis, side), axis], axis=1), np.array([*(a + b) / 2.0, 0.0]))
        swept = fcl.CollisionObject(fcl.Capsule(radius_m - 2e-5, length), pose)
        if any(fcl.collide(swept, grain, fcl.CollisionRequest(), fcl.CollisionResult()) for grain in grains):
            return False
    return True


@given(TREES, STEPS)
@settings(max_examples=150, deadline=None)
def test_a_passed_polyline_is_free_of_contact_with_everything_remembered(
    trees: list[tuple[float, float, float]], steps: list[tuple[float, float]]
) -> None:
    points = scene(trees)
    verdict = check(query(points, waypoints(steps), np.array([[-2.0, 1.0]])), PARAMS)
    if verdict.path_ned_m is None or verdict.margin_m is None or verdict.clearance_m is None:
        assert verdict.kind is VerdictKind.REFUSED
        return
    assert verdict.margin_m in PARAMS.margins_m()
    assert oracle_clear(verdict.path_ned_m, points, RADIUS_M)
    outside = points[np.hypot(*points.T) > RADIUS_M + verdict.margin_m + geometry.NEARER_M]
    assert oracle_clear(verdict.path_ned_m, outside, RADIUS_M + verdict.margin_m)
    inside = points[np.hypot(*points.T) <= RADIUS_M + verdict.margin_m + geometry.NEARER_M]
    if len(inside):
        nearest = geometry.points_to_polyline_distance(verdict.path_ned_m, inside)
        assert (nearest >= np.hypot(*inside.T) - geometry.NEARER_M - 1e-9).all()


@given(TREES, STEPS)
@settings(max_examples=80, deadline=None)
def test_a_mirrored_scene_gives_the_mirrored_verdict(
    trees: list[tuple[float, float, float]], steps: list[tuple[float, float]]
) -> None:
    askew = waypoints(steps) + np.outer(np.arange(len(steps)) ** 2, [0.0, 0.003])  # of equal ways the right one wins
    here = query(scene([*trees, (2.0, 0.31, 0.2)]), askew, np.array([[-2.0, 1.0]]))
    there = dataclasses.replace(
        here,
        points_ned_m=here.points_ned_m * MIRROR,
        proposal_ned_m=None if here.proposal_ned_m is None else here.proposal_ned_m * MIRROR,
        escape_ned_m=None if here.escape_ned_m is None else here.escape_ned_m * MIRROR,
    )
    one, other = check(here, PARAMS), check(there, PARAMS)
    assert (one.kind, one.margin_m) == (other.kind, other.margin_m)
    assert one.score == pytest.approx(other.score, abs=1e-9)
    if one.path_ned_m is not None:
        assert other.path_ned_m == pytest.approx(one.path_ned_m * MIRROR, abs=1e-9)


@given(TREES, STEPS)
@settings(max_examples=80, deadline=None)
def test_only_offending_waypoints_move_and_not_too_far(
    trees: list[tuple[float, float, float]], steps: list[tuple[float, float]]
) -> None:
    points, proposal = scene(trees), waypoints(steps)
    verdict = check(query(points, proposal), PARAMS)
    if verdict.kind is not VerdictKind.MODIFIED or verdict.path_ned_m is None or verdict.margin_m is None:
        return
    path = np.concatenate((np.zeros((1, 2)), proposal))
    moved = np.hypot(*(verdict.path_ned_m - path).T)
    assert (moved <= PARAMS.shift_max_m + 1e-9).all()
    for i in np.flatnonzero(moved > 1e-9):
        pieces = path[max(i - 1, 0) : i + 2]
        required = geometry.required_distance(path[0], points, RADIUS_M + verdict.margin_m, RADIUS_M)
        assert (geometry.points_to_polyline_distance(pieces, points) < required).any()


def test_a_clear_proposal_is_kept_at_the_full_margin() -> None:
    verdict = check(query(tree(2.0, 1.2)), PARAMS)
    assert verdict.kind is VerdictKind.KEPT and verdict.margin_m == PARAMS.margin_full_m
    assert verdict.path_ned_m is not None and verdict.path_ned_m[1:].tolist() == STRAIGHT.tolist()
    assert verdict.clearance_m == pytest.approx(1.2 - 0.3 - RADIUS_M, abs=0.01)
    assert verdict.keep_score == verdict.score and verdict.modify_score is None


def test_nothing_remembered_is_nothing_to_hit() -> None:
    verdict = check(query(np.zeros((0, 2))), PARAMS)
    assert verdict.kind is VerdictKind.KEPT and verdict.clearance_m == PARAMS.clearance_full_m


def test_a_proposal_through_a_tree_is_led_round_it() -> None:
    verdict = check(query(tree(2.1, 0.1)), PARAMS)
    assert verdict.kind is VerdictKind.MODIFIED and verdict.margin_m == PARAMS.margin_full_m
    assert verdict.path_ned_m is not None and verdict.path_ned_m[3, 1] < -0.6  # the shorter way round
    assert verdict.keep_score is None and verdict.modify_score == verdict.score


@pytest.mark.parametrize(("gap_m", "margin_m"), [(1.2, 0.2), (0.95, 0.1), (0.8, 0.05)])
def test_a_gap_is_passed_at_the_widest_declared_margin_that_fits(gap_m: float, margin_m: float) -> None:
    half = gap_m / 2.0
    points = np.concatenate((wall(2.0, -8.0, -half), wall(2.0, half, 8.0), [[2.0, half], [2.0, -half]]))
    verdict = check(query(points), PARAMS)
    assert verdict.kind is VerdictKind.KEPT and verdict.margin_m == margin_m


def test_a_gap_narrower_than_the_least_margin_is_never_flown() -> None:
    half = RADIUS_M + 0.04
    points = np.concatenate((wall(2.0, -8.0, -half), wall(2.0, half, 8.0), [[2.0, half], [2.0, -half]]))
    assert check(query(points), PARAMS).kind is VerdictKind.REFUSED


def test_the_better_score_is_flown_when_keep_and_modify_both_pass() -> None:
    points = np.concatenate((tree(2.0, 0.3 + RADIUS_M + 0.12), tree(3.0, 2.5)))
    verdict = check(query(points), PARAMS)
    assert verdict.keep_score is not None and verdict.modify_score is not None
    assert verdict.score == max(verdict.keep_score, verdict.modify_score)
    brave = check(query(points), dataclasses.replace(PARAMS, weight_clearance=0.0))
    assert brave.kind is VerdictKind.KEPT and brave.margin_m == PARAMS.margin_reduced_m
    careful = check(query(points), dataclasses.replace(PARAMS, weight_clearance=10.0))
    assert careful.kind is VerdictKind.MODIFIED and careful.margin_m == PARAMS.margin_full_m


def test_a_wall_across_leaves_the_escape_and_without_one_a_refusal() -> None:
    points = wall(1.5, -8.0, 8.0)
    back = check(query(points, escape=np.array([[-2.0, 0.0]])), PARAMS)
    assert back.kind is VerdictKind.ESCAPE and back.margin_m == PARAMS.margin_full_m
    assert back.keep_score is None and back.modify_score is None
    refused = check(query(points), PARAMS)
    assert refused == Verdict(VerdictKind.REFUSED, None, None, None, None, None, None)


def test_an_escape_is_cut_short_of_its_first_contact_and_refused_when_little_is_left() -> None:
    points = np.concatenate((wall(1.5, -8.0, 8.0), wall(-1.5, -8.0, 8.0)))
    cut = check(query(points, escape=np.array([[-4.0, 0.0]])), PARAMS)
    assert cut.kind is VerdictKind.ESCAPE and cut.path_ned_m is not None
    assert cut.path_ned_m[-1, 0] == pytest.approx(-1.5 + RADIUS_M + 0.2, abs=0.03)
    near = np.concatenate((wall(0.7, -8.0, 8.0), wall(-0.7, -8.0, 8.0)))
    assert check(query(near, escape=np.array([[-4.0, 0.0]])), PARAMS).kind is VerdictKind.REFUSED


def test_an_absent_proposal_a_nan_and_one_that_goes_nowhere_are_not_flown() -> None:
    nowhere, escape = np.zeros((0, 2)), np.array([[-2.0, 0.0]])
    for proposal in (None, STRAIGHT * math.nan, np.zeros((5, 2))):
        assert check(query(nowhere, proposal), PARAMS).kind is VerdictKind.REFUSED
        assert check(query(nowhere, proposal, escape), PARAMS).kind is VerdictKind.ESCAPE
    assert check(query(nowhere, None, escape * math.nan), PARAMS).kind is VerdictKind.REFUSED
    lost = dataclasses.replace(query(nowhere), start_ned_m=np.array([math.nan, 0.0]))
    assert check(lost, PARAMS).kind is VerdictKind.REFUSED


@pytest.mark.parametrize("clearance_m", [-0.02, 0.01, 0.04, 0.15])
def test_a_vehicle_close_to_a_tree_may_leave_it_but_not_come_nearer(clearance_m: float) -> None:
    points = tree(0.0, 0.3 + RADIUS_M + clearance_m, count=48)
    assert check(query(points, np.array([[0.0, -1.0]])), PARAMS).kind is VerdictKind.KEPT
    assert check(query(points, np.array([[0.0, 0.2]])), PARAMS).kind is not VerdictKind.KEPT


def test_an_accepted_path_survives_range_noise_and_not_a_new_obstacle_ahead() -> None:
    points = np.concatenate((tree(2.0, 0.3 + RADIUS_M + 0.21), tree(3.0, -0.3 - RADIUS_M - 0.21)))
    verdict = check(query(points), PARAMS)
    assert verdict.kind is VerdictKind.KEPT and verdict.path_ned_m is not None and verdict.margin_m is not None
    radius = PARAMS.recheck_radius_m(RADIUS_M, verdict.margin_m)
    noisy = points + np.random.default_rng(1).normal(0.0, 0.03, points.shape)
    assert recheck(verdict.path_ned_m, 0.0, noisy, radius)
    obstacle = tree(2.5, 0.0, 0.1)
    assert not recheck(verdict.path_ned_m, 0.0, obstacle, radius)
    assert recheck(verdict.path_ned_m, 3.2, obstacle, radius)  # behind
    assert not recheck(verdict.path_ned_m, math.nan, obstacle, radius)


def test_the_score_is_the_one_worked_out_by_hand() -> None:
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    goal = np.array([3.0, 10.0])
    assert turning_rad(path, np.zeros(2)) == pytest.approx(math.pi / 2)
    assert turning_rad(path, np.array([0.0, -2.0])) == pytest.approx(math.pi)
    won = math.hypot(3.0, 10.0) - 6.0
    assert progress_ratio(path, goal) == pytest.approx(won / 7.0)
    assert score(path, np.zeros(2), goal, 0.4, PARAMS) == pytest.approx(0.5 - 0.25 + won / 7.0)


def test_progress_raises_and_turning_lowers_the_score() -> None:
    goal = np.array([20.0, 0.0])
    straight, bent = np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[0.0, 0.0], [2.0, 1.0], [4.0, 0.0]])
    away = straight * -1.0
    values = [score(path, np.zeros(2), goal, 0.5, PARAMS) for path in (straight, bent, away)]
    assert values == sorted(values, reverse=True)


def test_where_the_first_choice_is_blocked_the_first_free_other_one_is_flown_as_it_is() -> None:
    left, right = STRAIGHT - np.array([0.0, 0.2]), np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 2.0]])
    asked = dataclasses.replace(query(tree(2.1, 0.1)), others_ned_m=(left, right))
    verdict = check(asked, PARAMS)
    assert verdict.kind is VerdictKind.NEXT and verdict.choice == 2 and verdict.keep_score is None
    assert verdict.path_ned_m is not None and verdict.path_ned_m[1:].tolist() == right.tolist()


def test_a_first_choice_that_passes_is_flown_whatever_else_there_is() -> None:
    verdict = check(dataclasses.replace(query(tree(2.0, 1.2)), others_ned_m=(STRAIGHT * 0.5,)), PARAMS)
    assert verdict.choice == 0 and verdict.path_ned_m is not None
    assert verdict.path_ned_m[1:].tolist() == STRAIGHT.tolist()
