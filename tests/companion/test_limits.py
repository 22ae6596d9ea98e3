import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from point_mass import DOWN_M, PointMass

from companion.core import geometry
from companion.core.types import F64, Setpoint
from companion.guidance import limits
from companion.guidance.follower import FollowerParams, Target, follow, progress
from companion.guidance.limits import Ahead, LimitsParams

PARAMS = LimitsParams()
RADIUS_M = 0.33
LINE = np.array([[0.0, 0.0], [30.0, 0.0]])
WALL_M = 16.0
ANY = st.floats(allow_nan=True, allow_infinity=True)


def wall(north_m: float) -> F64:
    return np.stack((np.full(101, north_m), np.linspace(-5.0, 5.0, 101)), axis=1)


def stop_from(speed_m_s: float, lag_s: float) -> float:
    """Farthest point of a stop; the scan that calls for it is one tick old."""
    vehicle, memory, farthest = PointMass(vel=(speed_m_s, 0.0), lag_s=lag_s), None, 0.0
    vehicle.tick(None)
    for _ in range(130):
        memory, setpoint = limits.hold(vehicle.state(), memory, 0.0, PARAMS)
        vehicle.tick(setpoint)
        farthest = max(farthest, float(vehicle.pos[0]))
    return farthest


@pytest.mark.parametrize(("d_free_m", "speed_m_s"), [(0.12, 0.25), (0.32, 0.64), (0.62, 1.14), (1.12, 1.85)])
def test_the_clamp_gives_the_speeds_worked_out_by_hand(d_free_m: float, speed_m_s: float) -> None:
    assert limits.stopping_speed(d_free_m) == pytest.approx(speed_m_s, abs=0.02)


@given(st.floats(0.0, 50.0), st.floats(0.5, 10.0), st.floats(0.0, 2.0))
def test_stopping_distance_is_the_inverse_of_stopping_speed(d_free_m: float, decel: float, tau_s: float) -> None:
    speed = limits.stopping_speed(d_free_m, decel, tau_s)
    assert limits.stopping_distance(speed, decel, tau_s) == pytest.approx(d_free_m, abs=1e-9)


@given(st.floats(0.05, 9.0), st.sampled_from([0.05, 0.12, 0.2]))
@settings(max_examples=40, deadline=None)
def test_a_hold_stops_inside_the_free_length_from_any_speed_the_clamp_allows(d_free_m: float, lag_s: float) -> None:
    assert stop_from(limits.stopping_speed(d_free_m), lag_s) <= d_free_m


@given(ANY, ANY, ANY, ANY, ANY, st.booleans())
@settings(max_examples=300, deadline=None)
def test_the_path_speed_is_never_nan_nor_above_clamp_and_cruise(
    s_m: float, cruise: float, free_m: float, clearance_m: float, s_fuzzy: float, ends_here: bool
) -> None:
    path = np.array([[0.0, 0.0], [2.0, 0.5], [4.0, -1.0], [5.0, 0.0]])
    speed = limits.path_speed(path, s_m, cruise, Ahead(free_m, clearance_m, s_fuzzy, ends_here), PARAMS)
    assert speed >= 0.0
    assert speed <= max(cruise, 0.0) or math.isnan(cruise)
    assert speed <= limits.stopping_speed(free_m)


@given(st.floats(0.3, 9.0), st.sampled_from([0.05, 0.12, 0.2]))
@settings(max_examples=30, deadline=None)
def test_the_stop_rule_comes_in_time_for_the_hull(speed_m_s: float, lag_s: float) -> None:
    assert (
        stop_from(speed_m_s, lag_s)
        <= limits.stopping_distance(speed_m_s, 6.0, PARAMS.stop_tau_s) + PARAMS.stop_margin_m
    )


def test_what_is_not_known_is_unsafe() -> None:
    clear = Ahead(20.0, 5.0, 1.0)
    assert limits.path_speed(LINE, 0.0, 3.0, clear, PARAMS) == 3.0
    assert limits.path_speed(LINE, math.nan, 3.0, clear, PARAMS) == 0.0
    assert limits.path_speed(LINE, 0.0, math.nan, clear, PARAMS) == 0.0
    assert limits.path_speed(LINE, 0.0, 3.0, dataclasses.replace(clear, free_length_m=math.nan), PARAMS) == 0.0
    unknown_side = limits.path_speed(LINE, 0.0, 3.0, dataclasses.replace(clear, clearance_m=math.nan), PARAMS)
    assert unknown_side == limits.path_speed(LINE, 0.0, 3.0, dataclasses.replace(clear, clearance_m=0.0), PARAMS)
    assert limits.limit_rise(math.nan, np.zeros(2), np.array([1.0, 0.0]), PARAMS) == 0.0


def test_a_gap_of_one_metre_twenty_is_passed_at_one_to_one_and_a_half_metres_a_second() -> None:
    beside = 1.2 / 2.0 - RADIUS_M
    for s_fuzzy in (0.2, 0.4, 0.6):
        speed = limits.path_speed(LINE, 0.0, 3.0, Ahead(6.0, beside, s_fuzzy), PARAMS)
        assert 0.95 < speed < 1.5
    assert limits.path_speed(LINE, 0.0, 3.0, Ahead(6.0, 0.02, 0.0), PARAMS) > 0.5  # slow, not frozen


def test_corners_ahead_slow_down_and_sharper_ones_more() -> None:
    clear = Ahead(20.0, 5.0, 1.0, ends_here=False)
    speeds = []
    for turn_deg in (0.0, 20.0, 45.0, 90.0, 150.0):
        turn = math.radians(turn_deg)
        path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0 + 3.0 * math.cos(turn), 3.0 * math.sin(turn)]])
        speeds.append(limits.path_speed(path, 2.9, 3.0, clear, PARAMS))
        assert limits.path_speed(path, 0.0, 3.0, clear, PARAMS) >= speeds[-1]
        assert limits.path_speed(path * [1.0, -1.0], 2.9, 3.0, clear, PARAMS) == speeds[-1]
        assert limits.path_speed(path, 3.5, 3.0, clear, PARAMS) == 3.0  # behind the corner
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] == 3.0 and speeds[-1] == PARAMS.corner_min_m_s


@given(st.floats(0.0, 2.95), st.floats(0.0, 0.3))
@settings(max_examples=60, deadline=None)
def test_before_a_corner_no_more_than_the_planned_braking_is_needed(s_m: float, step_m: float) -> None:
    corner = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]])
    now, later = limits.turn_speed(corner, s_m, 1.0, PARAMS), limits.turn_speed(corner, s_m + step_m, 1.0, PARAMS)
    if s_m + step_m < 3.0:
        assert now * now - later * later <= 2.0 * PARAMS.brake_m_s2 * step_m + 1e-9


def test_a_corner_is_cut_less_where_there_is_less_room() -> None:
    corner = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0]])
    assert limits.turn_speed(corner, 2.9, 0.1, PARAMS) < limits.turn_speed(corner, 2.9, 1.0, PARAMS)


def test_the_end_of_the_path_slows_down_unless_it_goes_on() -> None:
    near_end = limits.path_speed(LINE, 29.5, 3.0, Ahead(20.0, 5.0, 1.0), PARAMS)
    assert near_end == pytest.approx(0.5 / (1.0 / PARAMS.end_gain_1_s + PARAMS.lag_s))
    assert limits.path_speed(LINE, 30.0, 3.0, Ahead(20.0, 5.0, 1.0), PARAMS) == 0.0
    assert limits.path_speed(LINE, 29.5, 3.0, Ahead(20.0, 5.0, 1.0, ends_here=False), PARAMS) == 3.0


def test_the_commanded_speed_rises_from_the_measured_one() -> None:
    step = PARAMS.rise_m_s2 / PARAMS.response_1_s
    along = np.array([1.0, 0.0])
    assert limits.limit_rise(3.0, np.array([1.0, 0.5]), along, PARAMS) == pytest.approx(1.0 + step)
    assert limits.limit_rise(3.0, np.array([-2.0, 0.0]), along, PARAMS) == pytest.approx(step)
    assert limits.limit_rise(0.4, np.array([3.0, 0.0]), along, PARAMS) == 0.4


@pytest.mark.parametrize("cruise_m_s", [1.0, 3.0, 5.0])
@pytest.mark.parametrize("lag_s", [0.05, 0.12, 0.2])
def test_a_wall_across_the_path_is_approached_to_its_margin_and_not_nearer(cruise_m_s: float, lag_s: float) -> None:
    vehicle, points, s_m, margin = PointMass(lag_s=lag_s), wall(WALL_M), 0.0, 0.05
    while vehicle.t_s < 22.0:
        state = vehicle.state()
        free = geometry.swept_free_length(LINE, points, RADIUS_M + margin, s_m, 12.0)
        speed = limits.path_speed(LINE, s_m, cruise_m_s, Ahead(free, 5.0, 1.0), PARAMS)
        speed = limits.limit_rise(speed, state.vel_ned_m_s, np.array([1.0, 0.0]), PARAMS)
        assert vehicle.vel[0] <= limits.stopping_speed(free) + 0.1
        assert not limits.velocity_stop_needed(state.pos_ned_m, state.vel_ned_m_s, points, RADIUS_M - 0.06, PARAMS)
        at = progress(LINE, state.pos_ned_m, s_m, FollowerParams())
        followed = follow(LINE, state, at, Target(speed, DOWN_M, 0.0), FollowerParams())
        s_m = followed.s_m
        vehicle.tick(followed.setpoint)
        assert vehicle.pos[0] <= WALL_M - RADIUS_M - margin
    assert vehicle.pos[0] > WALL_M - RADIUS_M - margin - 0.05


def test_moving_at_a_wall_needs_a_stop_once_the_stopping_distance_reaches_it() -> None:
    vel = np.array([2.0, 0.0, 0.0])
    needed = limits.stopping_distance(2.0, PARAMS.decel_m_s2, PARAMS.stop_tau_s) + RADIUS_M + PARAMS.stop_margin_m
    for gap, stop in ((needed - 0.02, True), (needed + 0.02, False)):
        assert limits.velocity_stop_needed(np.zeros(3), vel, wall(gap), RADIUS_M, PARAMS) is stop
    assert not limits.velocity_stop_needed(np.zeros(3), -vel, wall(needed - 0.5), RADIUS_M, PARAMS)
    assert not limits.velocity_stop_needed(np.zeros(3), 0.01 * vel, wall(0.4), RADIUS_M, PARAMS)


def test_flying_past_beside_a_tree_needs_no_stop() -> None:
    tree = np.array([[0.0, 0.36], [0.1, 0.37], [-0.1, 0.37]])  # nearer than radius and margin
    assert not limits.velocity_stop_needed(np.zeros(3), np.array([1.5, 0.0, 0.0]), tree, RADIUS_M, PARAMS)
    assert limits.velocity_stop_needed(np.zeros(3), np.array([0.0, 1.5, 0.0]), tree, RADIUS_M, PARAMS)


def test_a_state_that_is_not_known_needs_a_stop() -> None:
    nowhere = np.zeros((0, 2))
    assert limits.velocity_stop_needed(np.zeros(3), np.array([math.nan, 0.0, 0.0]), nowhere, RADIUS_M, PARAMS)
    assert limits.velocity_stop_needed(np.full(3, math.nan), np.zeros(3), nowhere, RADIUS_M, PARAMS)
    assert not limits.velocity_stop_needed(np.zeros(3), np.array([5.0, 0.0, 0.0]), nowhere, RADIUS_M, PARAMS)


@pytest.mark.parametrize("speed_m_s", [0.0, 1.0, 2.9, 3.0, 6.0])
def test_a_hold_ends_at_rest_where_its_setpoint_says(speed_m_s: float) -> None:
    vehicle, memory = PointMass(vel=(speed_m_s, 0.0)), None
    for _ in range(400):
        memory, setpoint = limits.hold(vehicle.state(), memory, 0.7, PARAMS)
        vehicle.tick(setpoint)
    assert math.hypot(*vehicle.vel) < 0.02
    assert setpoint.pos_ned_m is not None and setpoint.yaw_rad == 0.7
    assert vehicle.pos == pytest.approx(setpoint.pos_ned_m[:2], abs=0.05)
    at_once = speed_m_s >= PARAMS.hold_from_m_s or speed_m_s == 0.0
    assert setpoint.pos_ned_m[0] == pytest.approx(0.0 if at_once else speed_m_s**2 / (2.0 * PARAMS.ramp_m_s2))


def test_a_hold_brakes_what_the_vehicle_gains_after_it_was_asked_for() -> None:
    soft = dataclasses.replace(PARAMS, hold_gain_1_s=0.0)
    assert held_while_speeding_up(soft) > 0.2
    assert held_while_speeding_up(PARAMS) < 0.16


def held_while_speeding_up(params: LimitsParams) -> float:
    """Metres from where a hold is asked for at 0.3 m/s, and rising by 2.75 m/s2, to the farthest point."""
    vehicle, memory, farthest = PointMass(lag_s=0.2), None, 0.0
    forward = np.array([1.0, 0.0, 0.0])
    while vehicle.vel[0] < 0.3:
        state = vehicle.state()
        velocity = state.vel_ned_m_s[0] + PARAMS.rise_m_s2 / PARAMS.response_1_s
        push = FollowerParams().acc_gain_1_s * PARAMS.rise_m_s2 / PARAMS.response_1_s
        vehicle.tick(Setpoint(state.t_s, state.pos_ned_m, velocity * forward, push * forward, None))
    began = float(vehicle.pos[0])
    for _ in range(130):
        memory, setpoint = limits.hold(vehicle.state(), memory, 0.0, params)
        vehicle.tick(setpoint)
        farthest = max(farthest, float(vehicle.pos[0]) - began)
    return farthest


def test_with_the_clamp_off_the_free_length_bounds_no_speed() -> None:
    assert limits.corridor_speed(0.5, dataclasses.replace(PARAMS, clamp=False)) == math.inf
