"""Does one tick of the landing ask for what the equations say? Hand-worked, with gains of its own."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core import frames
from companion.core.types import VehicleState
from companion.guidance import landing
from companion.guidance.landing import LandingCommand, LandingParams

TICK_S = 0.04
GOAL_NED_M = np.array([50.0, -7.0])
PARAMS = LandingParams(
    k_v=0.8, v_min_m_s=0.15, v_max_m_s=1.5, k_perp=0.3, k_perp_d=0.1, kp_pos=0.95, k_acc=2.2, a_max_m_s2=4.0,
    r_desc_m=0.4, r_touch_m=0.2, r_slope=0.1, h_commit_m=0.1, psi_desc_rad=0.35, r_yaw_m=0.5, k_z=0.5,
    vz_max_m_s=1.5, vz_min_m_s=0.5, r_tol_m=0.3, h_tol_m=0.3, v_tol_m_s=0.2, psi_tol_rad=0.35, settle_s=1.0,
)  # fmt: skip


def turned(state: VehicleState, yaw_rad: float) -> VehicleState:
    return replace(state, q_ned_frd=frames.quaternion(0.0, 0.0, yaw_rad))


def hovering(distance_m: float, height_m: float, yaw_rad: float = 0.0, t_s: float = 0.0) -> VehicleState:
    pos = np.array([GOAL_NED_M[0] - distance_m, GOAL_NED_M[1], -height_m])
    return VehicleState(t_s, pos, np.zeros(3), frames.quaternion(0.0, 0.0, yaw_rad), np.zeros(3))


@pytest.mark.parametrize(("height_m", "down_ref_m"), [(1.5, -1.5), (4.0, -3.0)])
def test_a_second_attempt_starts_from_where_the_vehicle_is_without_a_climb(height_m: float, down_ref_m: float) -> None:
    assert landing.start(hovering(1.0, height_m), GOAL_NED_M, 0.0, -3.0).down_ref_m == down_ref_m


@pytest.mark.parametrize(
    ("offset_ned_m", "vel_m_s", "yaw_error_rad", "settled"),
    [
        ((0.0, 0.0, 0.0), 0.0, 0.0, True),
        ((0.29, 0.0, 0.0), 0.0, 0.0, True),
        ((0.0, 0.31, 0.0), 0.0, 0.0, False),
        ((0.0, 0.0, -0.31), 0.0, 0.0, False),
        ((0.0, 0.0, 0.31), 0.0, 0.0, False),
        ((0.0, 0.0, 0.0), 0.21, 0.0, False),
        ((0.0, 0.0, 0.0), 0.0, 0.36, False),
        ((0.0, 0.0, 0.0), 0.0, -0.36, False),
    ],
)
def test_touchdown_needs_place_height_speed_and_heading_together(
    offset_ned_m: tuple[float, float, float], vel_m_s: float, yaw_error_rad: float, settled: bool
) -> None:
    pos = np.array([*GOAL_NED_M, 0.0]) + np.array(offset_ned_m)
    at_rest = VehicleState(0.0, pos, np.array([vel_m_s, 0.0, 0.0]), frames.quaternion(0, 0, 0.4), np.zeros(3))
    memory = landing.start(at_rest, GOAL_NED_M, 0.0, 0.0)
    touched = False
    for tick in range(30):
        state = turned(replace(at_rest, t_s=tick * TICK_S), 0.4 + yaw_error_rad)
        memory, command = landing.step(memory, state, True, PARAMS)
        touched |= command.touchdown
    assert touched == settled


def test_without_a_settling_time_touchdown_still_needs_the_ground() -> None:
    memory = landing.start(hovering(0.0, 2.0), GOAL_NED_M, 0.0, -2.0)
    quick = replace(PARAMS, settle_s=0.0)
    memory, command = landing.step(memory, hovering(0.0, 2.0, t_s=TICK_S), True, quick)
    assert not command.touchdown
    _, command = landing.step(memory, hovering(0.0, 0.0, t_s=2 * TICK_S), True, quick)
    assert command.touchdown


def test_one_disturbed_tick_starts_the_settling_time_again() -> None:
    still = hovering(0.0, 0.0)
    memory = landing.start(still, GOAL_NED_M, 0.0, 0.0)
    for tick in range(40):
        vel = np.array([0.5 if tick == 20 else 0.0, 0.0, 0.0])
        memory, command = landing.step(memory, replace(still, t_s=tick * TICK_S, vel_ned_m_s=vel), True, PARAMS)
        assert not command.touchdown


def test_far_out_the_yaw_points_at_the_goal_and_near_it_stays() -> None:
    memory = landing.start(hovering(2.0, 3.0, yaw_rad=1.0), GOAL_NED_M, 0.0, -3.0)
    memory, command = landing.step(memory, hovering(2.0, 3.0, yaw_rad=1.0), True, PARAMS)
    assert command.yaw_rad == pytest.approx(0.0)
    memory, command = landing.step(memory, hovering(0.4, 3.0), True, PARAMS)
    memory, command = landing.step(memory, hovering(-1.5, 3.0), True, PARAMS)  # overshot: the goal is behind now
    assert command.yaw_rad == pytest.approx(0.0)


def test_entered_on_top_of_the_goal_the_yaw_is_left_as_it_is() -> None:
    state = hovering(0.3, 3.0, yaw_rad=2.0)
    _, command = landing.step(landing.start(state, GOAL_NED_M, 0.0, -3.0), state, True, PARAMS)
    assert command.yaw_rad == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("distance_m", "height_m", "yaw_error_rad", "descends"),
    [
        (0.39, 3.0, 0.0, True),
        (0.41, 3.0, 0.0, False),
        (0.39, 3.0, 0.36, False),
        (0.39, 3.0, -0.36, False),
        (0.39, 3.0, 0.34, True),
        (0.24, 0.5, 0.0, True),  # funnel: 0.2 + 0.1 * 0.5
        (0.26, 0.5, 0.0, False),
        (0.39, 0.05, 0.0, True),  # already down: stays down
        (math.nan, 3.0, 0.0, False),
        (0.0, math.nan, 0.0, False),
        (0.0, 3.0, math.nan, False),
    ],
)
def test_descent_needs_the_goal_below_and_the_heading_aligned(
    distance_m: float, height_m: float, yaw_error_rad: float, descends: bool
) -> None:
    memory = landing.start(hovering(0.1, 3.0), GOAL_NED_M, 0.0, -3.0)
    state = hovering(distance_m, height_m, yaw_error_rad, t_s=TICK_S)
    after, command = landing.step(memory, state, True, PARAMS)
    assert command.descending == descends
    assert (after.down_ref_m > memory.down_ref_m) == descends


@pytest.mark.parametrize(
    ("distance_m", "speed_m_s"), [(0.0, 0.0), (0.1, 0.095), (0.17, 0.15), (1.0, 0.8), (1.875, 1.5), (9.0, 1.5)]
)
def test_closing_speed_is_the_clipped_profile_and_never_overshoots_the_goal(
    distance_m: float, speed_m_s: float
) -> None:
    assert landing.closing_speed(distance_m, PARAMS) == pytest.approx(speed_m_s)


@pytest.mark.parametrize(
    ("height_m", "rate_m_s"), [(-1.0, 0.5), (0.0, 0.5), (1.0, 0.5), (2.0, 1.0), (3.0, 1.5), (9.0, 1.5)]
)
def test_descent_rate_is_the_clipped_profile(height_m: float, rate_m_s: float) -> None:
    assert landing.descent_rate(height_m, PARAMS) == pytest.approx(rate_m_s)


def test_drift_off_the_approach_line_is_steered_back() -> None:
    memory = landing.start(hovering(2.0, 3.0), GOAL_NED_M, 0.0, -3.0)
    right = replace(hovering(1.0, 3.0), pos_ned_m=np.array([49.0, -6.5, -3.0]))
    pure_pursuit_m_s = -0.5 * landing.closing_speed(math.hypot(1.0, 0.5), PARAMS) / math.hypot(1.0, 0.5)
    still = landing.closing_velocity(memory.line, right, PARAMS)
    assert still[1] == pytest.approx(pure_pursuit_m_s - PARAMS.k_perp * 0.5)
    drifting = replace(right, vel_ned_m_s=np.array([0.0, 1.0, 0.0]))
    assert landing.closing_velocity(memory.line, drifting, PARAMS)[1] == pytest.approx(still[1] - PARAMS.k_perp_d)


@pytest.mark.parametrize(
    ("vel_ned_m_s", "acc_ned_m_s2"),
    [
        ((0.8, 0.0, 1.0), (0.0, 0.0, 0.0)),  # as asked: nothing to add, nothing vertical
        ((1.8, 0.0, 0.0), (-2.2, 0.0, 0.0)),
        ((3.8, 4.0, 0.0), (-2.4, -3.2, 0.0)),  # 2.2 * (-3, -4) cut to 4 in norm
    ],
)
def test_acceleration_makes_up_for_the_velocity_error_within_its_limit(
    vel_ned_m_s: tuple[float, float, float], acc_ned_m_s2: tuple[float, float, float]
) -> None:
    params = replace(PARAMS, k_perp_d=0.0)  # no lateral damping: hand-worked
    state = replace(hovering(1.0, 3.0), vel_ned_m_s=np.array(vel_ned_m_s))
    _, command = landing.step(landing.start(state, GOAL_NED_M, 0.0, -3.0), state, True, params)
    assert command.acc_ned_m_s2 == pytest.approx(np.array(acc_ned_m_s2))


def test_a_gap_in_time_moves_the_reference_by_one_bounded_step_and_a_step_back_by_none() -> None:
    memory = landing.start(hovering(0.1, 5.0), GOAL_NED_M, 0.0, -5.0)
    later, _ = landing.step(memory, hovering(0.1, 5.0, t_s=60.0), True, PARAMS)
    assert later.down_ref_m - memory.down_ref_m <= PARAMS.vz_max_m_s * landing.MAX_STEP_S
    earlier, command = landing.step(later, hovering(0.1, 5.0, t_s=59.0), True, PARAMS)
    assert earlier.down_ref_m == later.down_ref_m
    assert command.vel_ned_m_s[2] == 0.0


@settings(max_examples=30, deadline=None)
@given(
    north_m=st.floats(-2.5, 2.5),
    east_m=st.floats(-2.5, 2.5),
    vel_north_m_s=st.floats(-2, 2),
    vel_east_m_s=st.floats(-2, 2),
)
def test_a_mirrored_approach_gives_the_mirrored_setpoint(
    north_m: float, east_m: float, vel_north_m_s: float, vel_east_m_s: float
) -> None:
    def command(side: float) -> LandingCommand:
        goal = np.array([0.0, 0.0])
        first = VehicleState(
            0.0, np.array([-2.0, side, -3.0]), np.zeros(3), frames.quaternion(0, 0, side * 0.3), np.zeros(3)
        )
        now = VehicleState(
            TICK_S,
            np.array([north_m, side * east_m, -3.0]),
            np.array([vel_north_m_s, side * vel_east_m_s, 0.0]),
            frames.quaternion(0, 0, side * 0.1),
            np.zeros(3),
        )
        return landing.step(landing.start(first, goal, 0.0, -3.0), now, True, PARAMS)[1]

    one, other = command(1.0), command(-1.0)
    assert other.pos_ned_m == pytest.approx(one.pos_ned_m * [1, -1, 1])
    assert other.acc_ned_m_s2 == pytest.approx(one.acc_ned_m_s2 * [1, -1, 1])
    assert abs(frames.wrap_rad(other.yaw_rad + one.yaw_rad)) < 1e-9
