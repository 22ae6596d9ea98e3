import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_mass import DOWN_M, PointMass

from companion.core import geometry
from companion.core.types import F64, VehicleState
from companion.guidance import follower
from companion.guidance.follower import Followed, FollowerParams, Target
from companion.guidance.limits import Ahead, LimitsParams, limit_rise, path_speed

PARAMS = FollowerParams()
LIMITS = LimitsParams()
OPEN = Ahead(free_length_m=50.0, clearance_m=5.0, s_fuzzy=1.0)
LINE = np.array([[0.0, 0.0], [60.0, 0.0]])


def follow(path: F64, state: VehicleState, s_min_m: float, target: Target, params: FollowerParams) -> Followed:
    """From progress s_min_m on."""
    at = follower.progress(path, state.pos_ned_m, s_min_m, params)
    return follower.follow(path, state, at, target, params)


def slalom(wavelength_m: float) -> F64:
    north = np.arange(0.0, 18.0, 0.1)
    return np.stack((north, 0.5 * np.sin(math.tau * north / wavelength_m)), axis=1)


def fly_at(path: F64, vehicle: PointMass, speed_m_s: float, duration_s: float) -> tuple[F64, F64]:
    """Distances from the path and progress, one per tick, at a given speed."""
    s_m, rows = 0.0, []
    while vehicle.t_s < duration_s and s_m < geometry.length(path) - 1.0:
        followed = follow(path, vehicle.state(), s_m, Target(speed_m_s, DOWN_M, 0.0), PARAMS)
        s_m = followed.s_m
        rows.append((followed.distance_m, s_m))
        vehicle.tick(followed.setpoint)
    return np.array(rows)[:, 0], np.array(rows)[:, 1]


def fly_limited(path: F64, vehicle: PointMass, ahead: Ahead, duration_s: float) -> tuple[float, float]:
    """Farthest from the path, and progress at the end, with the motion limits."""
    s_m, worst = 0.0, 0.0
    while vehicle.t_s < duration_s:
        state = vehicle.state()
        speed = path_speed(path, s_m, 3.0, ahead, LIMITS)
        speed = limit_rise(speed, state.vel_ned_m_s, geometry.tangent_at(path, s_m), LIMITS)
        followed = follow(path, state, s_m, Target(speed, DOWN_M, 0.0), PARAMS)
        s_m, worst = followed.s_m, max(worst, followed.distance_m)
        vehicle.tick(followed.setpoint)
    return worst, s_m


@pytest.mark.parametrize("wavelength_m", [3.0, 4.5])
def test_a_slalom_at_one_and_a_half_metres_a_second_is_tracked_within_twelve_centimetres(wavelength_m: float) -> None:
    path = slalom(wavelength_m)
    start = geometry.tangent_at(path, 0.0) * 1.5
    distance, _ = fly_at(path, PointMass(vel=(start[0], start[1])), 1.5, 20.0)
    assert distance.max() < 0.12


@given(
    st.floats(-8.0, 8.0),
    st.floats(0.5, 3.0),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.floats(-math.pi, math.pi),
)
@settings(max_examples=25, deadline=None)
def test_the_line_is_reached_from_any_offset_course_and_speed(
    offset_m: float, speed_m_s: float, vel_n: float, vel_e: float, course_rad: float
) -> None:
    along = np.array([math.cos(course_rad), math.sin(course_rad)])
    across = np.array([-along[1], along[0]])
    path = np.array([np.zeros(2), 60.0 * along])
    start = 2.0 * along + offset_m * across
    distance, progress = fly_at(path, PointMass((start[0], start[1]), (vel_n, vel_e)), speed_m_s, 18.0)
    assert distance[-1] < 0.1 or progress[-1] > 58.0
    assert (np.diff(progress) >= 0.0).all()


@given(st.lists(st.tuples(st.floats(0.4, 1.4), st.floats(-1.0, 1.0)), min_size=5, max_size=5))
@settings(max_examples=15, deadline=None)
def test_five_waypoints_in_a_narrow_place_are_tracked_within_the_clearance(legs: list[tuple[float, float]]) -> None:
    courses = np.cumsum([turn for _, turn in legs])
    steps = np.array(
        [[length * math.cos(c), length * math.sin(c)] for (length, _), c in zip(legs, courses, strict=True)]
    )
    path = np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
    worst, s_m = fly_limited(path, PointMass(), dataclasses.replace(OPEN, clearance_m=0.2, s_fuzzy=0.3), 16.0)
    assert worst < 0.1
    assert s_m > geometry.length(path) - 0.1


def test_the_vehicle_comes_to_rest_at_the_end_and_not_beyond() -> None:
    vehicle = PointMass()
    path = np.array([[0.0, 0.0], [12.0, 0.0]])
    fly_limited(path, vehicle, OPEN, 14.0)
    assert 11.9 < vehicle.pos[0] < 12.05
    assert math.hypot(*vehicle.vel) < 0.05


def test_three_metres_a_second_are_reached_on_an_open_line_with_gentle_acceleration() -> None:
    vehicle, s_m, speeds = PointMass(), 0.0, [0.0]
    while vehicle.t_s < 6.0:
        state = vehicle.state()
        speed = limit_rise(path_speed(LINE, s_m, 3.0, OPEN, LIMITS), state.vel_ned_m_s, np.array([1.0, 0.0]), LIMITS)
        followed = follow(LINE, state, s_m, Target(speed, DOWN_M, 0.0), PARAMS)
        s_m = followed.s_m
        vehicle.tick(followed.setpoint)
        speeds.append(float(vehicle.vel[0]))
    assert max(speeds) == pytest.approx(3.0, abs=0.3)
    assert speeds[50] > 2.5  # two seconds from rest
    assert np.diff(speeds).max() / 0.04 < 3.2


def test_progress_never_jumps_to_the_other_leg_of_a_hairpin() -> None:
    hairpin = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 0.5], [0.0, 0.5]])
    vehicle, s_m = PointMass(), 0.0
    while vehicle.t_s < 25.0:
        speed = path_speed(hairpin, s_m, 2.0, OPEN, LIMITS)
        followed = follow(hairpin, vehicle.state(), s_m, Target(speed, DOWN_M, 0.0), PARAMS)
        assert s_m <= followed.s_m <= s_m + 0.6  # round the bend the nearest place may skip the short leg
        s_m = followed.s_m
        vehicle.tick(followed.setpoint)
    assert s_m > 10.3


def test_a_vehicle_blown_onto_the_other_leg_goes_back_to_its_own() -> None:
    hairpin = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 1.0], [0.0, 1.0]])
    blown = PointMass((2.0, 0.95))
    followed = follow(hairpin, blown.state(), 1.9, Target(1.0, DOWN_M, 0.0), PARAMS)
    assert followed.s_m == pytest.approx(2.0)
    assert followed.setpoint.pos_ned_m is not None and followed.setpoint.pos_ned_m[1] < 0.3


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.0, 3.0))
@settings(max_examples=50, deadline=None)
def test_a_mirrored_state_gives_the_mirrored_setpoint(pos_e: float, vel_n: float, vel_e: float, speed: float) -> None:
    path = np.array([[0.0, 0.0], [2.0, 0.3], [4.0, -0.5], [6.0, 1.0]])
    target = Target(speed, DOWN_M, 0.0)
    one = follow(path, PointMass((1.0, pos_e), (vel_n, vel_e)).state(), 0.5, target, PARAMS).setpoint
    other = follow(path * [1.0, -1.0], PointMass((1.0, -pos_e), (vel_n, -vel_e)).state(), 0.5, target, PARAMS).setpoint
    for a, b in zip(
        (one.pos_ned_m, one.vel_ned_m_s, one.acc_ned_m_s2),
        (other.pos_ned_m, other.vel_ned_m_s, other.acc_ned_m_s2),
        strict=True,
    ):
        assert a is not None and b is not None
        assert b == pytest.approx(a * [1.0, -1.0, 1.0], abs=1e-12)


def test_down_and_yaw_are_passed_through_and_feed_forward_is_bounded() -> None:
    far = PointMass((3.0, 20.0), (-9.0, 9.0)).state()
    setpoint = follow(LINE, far, 2.5, Target(3.0, -4.5, 1.25), PARAMS).setpoint
    assert setpoint.pos_ned_m is not None and setpoint.vel_ned_m_s is not None and setpoint.acc_ned_m_s2 is not None
    assert setpoint.pos_ned_m[2] == -4.5 and setpoint.yaw_rad == 1.25
    assert math.dist(setpoint.pos_ned_m[:2], far.pos_ned_m[:2]) <= PARAMS.offset_max_m + 1e-9
    assert math.hypot(*setpoint.acc_ned_m_s2) <= PARAMS.acc_max_m_s2 + 1e-9
    assert math.hypot(*setpoint.vel_ned_m_s) < 3.0  # far off the path the speed falls


def test_a_course_correction_turns_the_feed_forward_and_nothing_else() -> None:
    state = PointMass((3.0, 0.0)).state()
    plain = follow(LINE, state, 2.5, Target(2.0, DOWN_M, 0.0), PARAMS).setpoint
    turned = follow(LINE, state, 2.5, Target(2.0, DOWN_M, 0.0, math.pi / 6), PARAMS).setpoint
    assert turned.vel_ned_m_s == pytest.approx([2.0 * math.cos(math.pi / 6), 1.0, 0.0])
    assert turned.pos_ned_m == pytest.approx(plain.pos_ned_m)


def test_a_state_that_is_not_known_asks_for_the_path_itself_at_no_speed() -> None:
    lost = PointMass((math.nan, 0.0), (math.nan, 0.0)).state()
    setpoint = follow(LINE, lost, 4.0, Target(2.0, DOWN_M, 0.0), PARAMS).setpoint
    assert setpoint.pos_ned_m == pytest.approx([4.0, 0.0, DOWN_M])
    assert setpoint.vel_ned_m_s == pytest.approx([0.0, 0.0, 0.0])
    assert setpoint.acc_ned_m_s2 == pytest.approx([0.0, 0.0, 0.0])


def test_a_single_place_is_held() -> None:
    vehicle = PointMass((0.5, 0.3))
    place = np.array([[0.0, 0.0]])
    for _ in range(250):
        vehicle.tick(follow(place, vehicle.state(), 0.0, Target(1.0, DOWN_M, 0.0), PARAMS).setpoint)
    assert math.hypot(*vehicle.pos) < 0.05
