"""Does the landing profile put a PX4-shaped vehicle on its goal, and pause where it must?"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core import frames
from companion.core.types import F64, VehicleState
from companion.guidance import landing
from companion.guidance.landing import LandingCommand, LandingParams, LandingState

PHYSICS_S = 0.01
TICK_S = 0.04
LATENCY_TICKS = 1
PARAMS = LandingParams()
GOAL_NED_M = np.array([50.0, -7.0])


@dataclass
class PointMass:
    """Double integrator under PX4-shaped loops: position P, velocity PI, acceleration limit, yaw rate limit."""

    pos: F64
    vel: F64
    yaw: float = 0.0
    wind_acc: F64 = field(default_factory=lambda: np.zeros(3))
    integral: F64 = field(default_factory=lambda: np.zeros(3))
    ground_down_m: float = 0.0
    on_ground: bool = False
    touch_speed_m_s: float = 0.0

    def step(self, cmd: LandingCommand) -> None:
        gains_p, gains_v, gains_i = np.array([0.95, 0.95, 1.0]), np.array([1.8, 1.8, 4.0]), np.array([0.4, 0.4, 2.0])
        vel_sp = gains_p * (cmd.pos_ned_m - self.pos) + cmd.vel_ned_m_s
        vel_sp[2] = min(vel_sp[2], 3.0)
        error = vel_sp - self.vel
        acc = gains_v * error + self.integral + cmd.acc_ned_m_s2
        norm = float(np.linalg.norm(acc[:2]))
        if norm > 6.0:
            acc[:2] *= 6.0 / norm
        else:
            self.integral = self.integral + gains_i * error * PHYSICS_S
        self.vel = self.vel + (np.clip(acc, -6.0, 6.0) + self.wind_acc) * PHYSICS_S
        self.pos = self.pos + self.vel * PHYSICS_S
        turn = frames.wrap_rad(cmd.yaw_rad - self.yaw)
        self.yaw = frames.wrap_rad(self.yaw + max(-1.0, min(1.0, 2.8 * turn)) * PHYSICS_S)
        if self.pos[2] >= self.ground_down_m:
            self.touch_speed_m_s = max(self.touch_speed_m_s, float(self.vel[2]))
            self.pos[2] = self.ground_down_m
            self.vel = np.zeros(3)
            self.on_ground = True

    def state(self, t_s: float) -> VehicleState:
        q = frames.quaternion(0.0, 0.0, self.yaw)
        return VehicleState(t_s, self.pos.copy(), self.vel.copy(), q, np.zeros(3))


@dataclass(frozen=True)
class Sample:
    """One tick of a flight."""

    t_s: float
    state: VehicleState
    landing: LandingState
    command: LandingCommand


def fly(
    body: PointMass,
    limit_s: float = 60.0,
    safe: Callable[[float], bool] = lambda t_s: True,
    goal_down_m: float = 0.0,
    until_ground: bool = True,
) -> list[Sample]:
    memory = landing.start(body.state(0.0), GOAL_NED_M, goal_down_m, float(body.pos[2]))
    pending: list[LandingCommand] = []
    samples = []
    for tick in range(int(limit_s / TICK_S)):
        t_s = tick * TICK_S
        state = body.state(t_s)
        memory, command = landing.step(memory, state, safe(t_s), PARAMS)
        samples.append(Sample(t_s, state, memory, command))
        pending.append(command)
        for _ in range(round(TICK_S / PHYSICS_S)):
            body.step(pending[max(0, len(pending) - 1 - LATENCY_TICKS)])
        if body.on_ground and until_ground:
            break
    return samples


def entry(
    distance_m: float, bearing_rad: float, height_m: float, speed_m_s: float = 0.0, yaw: float = 0.0
) -> PointMass:
    away = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    north, east = GOAL_NED_M - distance_m * away
    vel = speed_m_s * away
    return PointMass(np.array([north, east, -height_m]), np.array([vel[0], vel[1], 0.0]), yaw)


def landing_error_m(body: PointMass) -> float:
    return float(np.hypot(*(body.pos[:2] - GOAL_NED_M)))


def turned(state: VehicleState, yaw_rad: float) -> VehicleState:
    return replace(state, q_ned_frd=frames.quaternion(0.0, 0.0, yaw_rad))


def hovering(distance_m: float, height_m: float, yaw_rad: float = 0.0, t_s: float = 0.0) -> VehicleState:
    return entry(distance_m, 0.0, height_m, yaw=yaw_rad).state(t_s)


@settings(max_examples=60, deadline=None)
@given(
    distance_m=st.floats(0.0, 2.0),
    bearing_rad=st.floats(-3.1, 3.1),
    height_m=st.floats(2.5, 10.0),
    speed_m_s=st.floats(0.0, 3.0),
    yaw=st.floats(-3.1, 3.1),
)
def test_in_still_air_every_entry_ends_on_the_goal(
    distance_m: float, bearing_rad: float, height_m: float, speed_m_s: float, yaw: float
) -> None:
    body = entry(distance_m, bearing_rad, height_m, speed_m_s, yaw)
    flight = fly(body)
    assert body.on_ground
    assert landing_error_m(body) < 0.2
    assert body.touch_speed_m_s < 0.7
    assert flight[-1].t_s < 8.0 + height_m


def test_gusts_are_outwaited() -> None:
    body = entry(1.5, 2.0, 5.0, 1.0)
    body.integral = np.array([-1.0, 0.0, 0.0])  # the mean wind is already trimmed out in cruise
    memory = landing.start(body.state(0.0), GOAL_NED_M, 0.0, -5.0)
    t_s = 0.0
    while not body.on_ground and t_s < 40.0:
        body.wind_acc = np.array([1.0 + 0.5 * math.sin(1.1 * t_s), 0.5 * math.sin(0.7 * t_s), 0.0])
        memory, command = landing.step(memory, body.state(t_s), True, PARAMS)
        for _ in range(4):
            body.step(command)
        t_s += TICK_S
    assert body.on_ground
    assert landing_error_m(body) < 0.5


@settings(max_examples=25, deadline=None)
@given(distance_m=st.floats(0.0, 2.5), height_m=st.floats(2.5, 10.0), unsafe_from_s=st.floats(0.0, 8.0))
def test_the_height_reference_only_sinks_at_a_bounded_rate_and_stops_at_once_when_unsafe(
    distance_m: float, height_m: float, unsafe_from_s: float
) -> None:
    def safe(t_s: float) -> bool:
        return not unsafe_from_s <= t_s < unsafe_from_s + 2.0

    flight = fly(entry(distance_m, 1.0, height_m, 1.0), safe=safe)
    for before, now in itertools.pairwise(flight):
        sunk_m = now.landing.down_ref_m - before.landing.down_ref_m
        assert 0.0 <= sunk_m <= PARAMS.vz_max_m_s * TICK_S + 1e-9
        assert now.landing.down_ref_m <= float(now.state.pos_ned_m[2]) + PARAMS.z_lead_m + 1e-9 or sunk_m == 0.0
        if not safe(now.t_s):
            assert sunk_m == 0.0
            assert now.command.vel_ned_m_s[2] == 0.0
            assert not now.command.descending


def test_the_descent_goes_on_after_a_pause() -> None:
    body = entry(1.0, 0.0, 4.0)
    fly(body, safe=lambda t_s: not 3.0 < t_s < 6.0)
    assert body.on_ground


@pytest.mark.parametrize(("height_m", "down_ref_m"), [(1.5, -1.5), (4.0, -3.0)])
def test_a_second_attempt_starts_from_where_the_vehicle_is_without_a_climb(height_m: float, down_ref_m: float) -> None:
    assert landing.start(hovering(1.0, height_m), GOAL_NED_M, 0.0, -3.0).down_ref_m == down_ref_m


def test_the_descent_is_slow_near_the_ground() -> None:
    flight = fly(entry(0.5, 0.0, 8.0))
    low = [s for s in flight if s.state.pos_ned_m[2] > -1.0]
    assert low
    assert all(s.command.vel_ned_m_s[2] == PARAMS.vz_min_m_s for s in low)


def test_the_descent_rate_grows_no_faster_than_its_limit() -> None:
    flight = fly(entry(0.0, 0.0, 10.0))
    rates = [float(s.command.vel_ned_m_s[2]) for s in flight]
    assert max(rates) == PARAMS.vz_max_m_s
    assert max(b - a for a, b in itertools.pairwise(rates)) <= PARAMS.az_m_s2 * TICK_S + 1e-9


@pytest.mark.parametrize("true_ground_down_m", [-0.8, 0.0, 1.5])
def test_ground_higher_or_lower_than_believed_is_still_reached(true_ground_down_m: float) -> None:
    body = entry(0.3, 0.0, 6.0)
    body.ground_down_m = true_ground_down_m
    fly(body)
    assert body.on_ground
    assert body.touch_speed_m_s < 1.0


def test_the_reference_stays_within_reach_of_goal_and_vehicle_on_the_ground() -> None:
    flight = fly(entry(0.0, 0.0, 3.0), limit_s=30.0, until_ground=False)
    assert max(s.landing.down_ref_m for s in flight) == pytest.approx(PARAMS.z_lead_m)
    bottomless = entry(0.0, 0.0, 3.0)
    bottomless.ground_down_m = 1e3
    flight = fly(bottomless, limit_s=30.0)
    assert max(s.landing.down_ref_m for s in flight) == pytest.approx(PARAMS.z_below_m)


def test_touchdown_needs_the_whole_settling_time_on_the_ground() -> None:
    flight = fly(entry(0.2, 0.0, 3.0), limit_s=20.0, until_ground=False)
    contact_s = next(s.t_s for s in flight if s.state.pos_ned_m[2] >= 0.0)
    touchdown_s = next(s.t_s for s in flight if s.command.touchdown)
    assert touchdown_s >= contact_s + PARAMS.settle_s - PARAMS.h_tol_m / PARAMS.vz_min_m_s
    assert touchdown_s <= contact_s + PARAMS.settle_s + 2 * TICK_S


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


def test_a_raised_pad_is_landed_on_and_judged_by_its_own_height() -> None:
    body = entry(0.5, 0.0, 5.0)
    body.ground_down_m = -1.2
    flight = fly(body, limit_s=20.0, goal_down_m=-1.2, until_ground=False)
    assert flight[-1].command.touchdown
    assert body.touch_speed_m_s < 0.7


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


def test_a_fast_entry_does_not_overshoot_the_goal() -> None:
    flight = fly(entry(2.0, 0.0, 3.0, speed_m_s=3.0))
    assert max(float(s.state.pos_ned_m[0] - GOAL_NED_M[0]) for s in flight) < 0.1


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
