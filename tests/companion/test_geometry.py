import itertools
import math

import fcl
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.core import geometry
from companion.core.types import F64

RADIUS_M = 0.4
GRAIN_M = 1e-4  # points are tiny spheres for the oracle
COORDINATE = st.floats(-6.0, 6.0).map(lambda x: round(x, 3))
VERTICES = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=2, max_size=6).map(np.array)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE), min_size=1, max_size=12).map(np.array)
PLACE = st.tuples(COORDINATE, COORDINATE).map(np.array)


def dense(path: F64) -> F64:
    return geometry.resample(path, 0.01)


def capsule(a: F64, b: F64, radius_m: float) -> fcl.CollisionObject:
    """The area a disc sweeps from a to b, as a lying capsule."""
    length = math.dist(a, b)
    shape = fcl.Capsule(radius_m, length)
    axis = np.array([*(b - a), 0.0]) / length if length > 0.0 else np.array([1.0, 0.0, 0.0])
    side = np.array([-axis[1], axis[0], 0.0])
    rotation = np.stack([side, np.cross(axis, side), axis], axis=1)
    return fcl.CollisionObject(shape, fcl.Transform(rotation, np.array([*(a + b) / 2.0, 0.0])))


def oracle_touches(path: F64, points: F64, radius_m: float) -> bool:
    grains = [
        fcl.CollisionObject(fcl.Sphere(GRAIN_M), fcl.Transform(np.eye(3), np.array([*point, 0.0]))) for point in points
    ]
    for a, b in itertools.pairwise(path):
        swept = capsule(a, b, radius_m)
        if any(fcl.collide(swept, grain, fcl.CollisionRequest(), fcl.CollisionResult()) for grain in grains):
            return True
    return False


@given(VERTICES, POINTS)
@settings(max_examples=200, deadline=None)
def test_a_swept_disc_touches_exactly_when_fcl_says_so(path: F64, points: F64) -> None:
    points = points[np.hypot(*(points - path[0]).T) > RADIUS_M + 0.001]
    nearest = geometry.nearest_distance(path, points)
    assume(geometry.length(path) > 0.0 and abs(nearest - RADIUS_M) > 0.001)
    touches = geometry.swept_free_length(path, points, RADIUS_M) < geometry.length(path)
    assert touches == oracle_touches(path, points, RADIUS_M)


@pytest.mark.parametrize("bearing_deg", range(0, 360, 15))
@pytest.mark.parametrize(("distance_m", "touches"), [(RADIUS_M - 0.001, True), (RADIUS_M + 0.001, False)])
def test_a_lone_point_beside_either_end_is_touched_inside_the_radius_only(
    bearing_deg: int, distance_m: float, touches: bool
) -> None:
    bearing = math.radians(bearing_deg)
    there = np.array([math.cos(bearing), math.sin(bearing)])
    path = np.array([[5.0, 5.0], [3.0, 0.0], [0.0, 0.0]]) - 2.0 * there  # ends where no other piece comes near
    point = path[-1] + distance_m * there
    if math.dist(geometry.point_at(path, geometry.project(path, point).s_m), path[-1]) < 1e-9:
        free = geometry.swept_free_length(path, point[None], RADIUS_M)
        assert (free < geometry.length(path)) is touches


@given(VERTICES, POINTS)
@settings(max_examples=150, deadline=None)
def test_up_to_the_free_length_nothing_is_touched_and_just_beyond_it_is(path: F64, points: F64) -> None:
    assume(geometry.length(path) > 0.0)
    free = geometry.swept_free_length(path, points, RADIUS_M)
    required = geometry.required_distance(path[0], points, RADIUS_M)
    flown = geometry.part(path, 0.0, free)
    assert (geometry.points_to_polyline_distance(flown, points) >= required - 1e-6).all()
    if free < geometry.length(path):
        beyond = geometry.part(path, 0.0, free + 1e-3)
        assert (geometry.points_to_polyline_distance(beyond, points) < required + 1e-6).any()


@given(VERTICES, POINTS)
@settings(max_examples=100, deadline=None)
def test_distances_equal_those_to_a_densely_sampled_polyline(path: F64, points: F64) -> None:
    places = dense(path)
    brute = np.hypot(points[:, None, 0] - places[:, 0], points[:, None, 1] - places[:, 1]).min(axis=1)
    exact = geometry.points_to_polyline_distance(path, points)
    assert (exact <= brute + 1e-9).all()
    assert (brute - exact <= 0.006).all()


@given(VERTICES, POINTS, st.floats(0.0, 2.0))
@settings(max_examples=100, deadline=None)
def test_every_point_within_reach_is_among_the_near_ones(path: F64, points: F64, reach_m: float) -> None:
    near = {tuple(point) for point in geometry.points_near(path, points, reach_m)}
    within = points[geometry.points_to_polyline_distance(path, points) < reach_m - 1e-9]
    assert {tuple(point) for point in within} <= near


@given(VERTICES, PLACE)
@settings(max_examples=150, deadline=None)
def test_a_projection_is_the_nearest_place_and_its_sign_says_the_side(path: F64, pos: F64) -> None:
    at = geometry.project(path, pos)
    assert at.distance_m == pytest.approx(float(geometry.points_to_polyline_distance(path, pos[None])[0]), abs=1e-9)
    assert math.dist(geometry.point_at(path, at.s_m), pos) == pytest.approx(at.distance_m, abs=1e-7)
    mirrored = geometry.project(path * [1.0, -1.0], pos * [1.0, -1.0])
    assert mirrored.s_m == at.s_m and mirrored.lateral_m == -at.lateral_m


@given(VERTICES, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@settings(max_examples=100, deadline=None)
def test_a_part_has_the_length_asked_for_and_lies_on_the_polyline(path: F64, a: float, b: float) -> None:
    whole = geometry.length(path)
    low, high = sorted((a * whole, b * whole))
    piece = geometry.part(path, low, high)
    assert geometry.length(piece) == pytest.approx(high - low, abs=1e-6)
    assert (geometry.points_to_polyline_distance(path, piece) < 1e-6).all()


@given(VERTICES)
@settings(max_examples=50, deadline=None)
def test_resampling_keeps_the_ends_and_the_spacing(path: F64) -> None:
    places = geometry.resample(path, 0.25)
    assert np.allclose(places[[0, -1]], path[[0, -1]])
    assert (np.hypot(*np.diff(places, axis=0).T) <= 0.25 + 1e-9).all()


def test_right_of_a_northward_line_is_east_and_positive() -> None:
    at = geometry.project(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([3.0, 2.0]))
    assert at == (3.0, 2.0, 2.0)


def test_a_window_keeps_the_projection_off_a_near_later_piece() -> None:
    hairpin = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 0.4], [0.0, 0.4]])
    pos = np.array([2.0, 0.3])
    assert geometry.project(hairpin, pos).s_m == pytest.approx(8.4)
    assert geometry.project(hairpin, pos, 1.5, 2.5).s_m == pytest.approx(2.0)


def test_repeated_vertices_and_a_single_place_are_harmless() -> None:
    path = np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [2.0, 0.0]])
    assert geometry.length(path) == 2.0
    assert geometry.tangent_at(path, 0.0).tolist() == [1.0, 0.0]
    alone = np.array([[1.0, 1.0]])
    assert geometry.length(alone) == 0.0
    assert geometry.project(alone, np.array([1.0, 3.0])).distance_m == 2.0
    assert geometry.swept_free_length(alone, np.zeros((0, 2)), 0.3) == 0.0


def test_without_points_the_whole_polyline_or_the_horizon_is_free() -> None:
    path = np.array([[0.0, 0.0], [10.0, 0.0]])
    assert geometry.swept_free_length(path, np.zeros((0, 2)), 0.4) == 10.0
    assert geometry.swept_free_length(path, np.zeros((0, 2)), 0.4, 2.0, 3.0) == 3.0
    assert geometry.swept_free_length(path, np.array([[6.0, 0.0]]), 0.4, 2.0, 8.0) == pytest.approx(3.6)


def test_a_point_inside_the_radius_counts_only_once_the_path_brings_it_nearer() -> None:
    beside = np.array([[0.0, 0.3]])
    away = np.array([[0.0, 0.0], [0.0, -2.0]])
    towards = np.array([[0.0, 0.0], [0.0, 2.0]])
    assert geometry.swept_free_length(away, beside, 0.4) == 2.0
    assert geometry.swept_free_length(towards, beside, 0.4) == pytest.approx(geometry.NEARER_M)


def test_a_floor_lets_a_point_inside_it_only_get_farther_away() -> None:
    start, points = np.zeros(2), np.array([[0.3, 0.0], [0.335, 0.0], [0.38, 0.0], [2.0, 0.0]])
    required = geometry.required_distance(start, points, 0.53, 0.33)
    assert required == pytest.approx([0.3, 0.33, 0.37, 0.53], abs=1e-5)


def test_a_disc_cannot_slip_between_two_points_nearer_than_its_width() -> None:
    through = np.array([[-3.0, 0.0], [3.0, 0.0]])
    for half_gap in (0.1, 0.2, 0.39):
        pair = np.array([[0.0, -half_gap], [0.0, half_gap]])
        assert geometry.swept_free_length(through, pair, 0.4) < 6.0
    assert geometry.swept_free_length(through, np.array([[0.0, -0.41], [0.0, 0.41]]), 0.4) == 6.0


def test_the_end_of_a_polyline_is_found_whatever_rounding_makes_of_its_length() -> None:
    courses = np.cumsum([0.0, 0.0, 1.0, 1.0, 1.0])
    steps = np.array([1.0, 1.0, 1.0, 1.0, 0.5])[:, None] * np.stack([np.cos(courses), np.sin(courses)], axis=1)
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    end_s = geometry.length(path)
    for past in (0.0, 1e-9, 1.0):
        assert geometry.project(path, path[-1], end_s + past, end_s + past).distance_m < 1e-9


def test_a_polyline_is_made_longer_along_its_last_piece() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    assert geometry.extended(path, 1.5) == pytest.approx(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.5]]))
    assert geometry.extended(path, 0.0) is path
    assert geometry.extended(path[:1], 1.0) == pytest.approx(path[:1])
