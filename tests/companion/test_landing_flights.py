"""Does the landing profile put a PX4-shaped vehicle on its goal, and pause where it must?"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

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


def test_a_raised_pad_is_landed_on_and_judged_by_its_own_height() -> None:
    body = entry(0.5, 0.0, 5.0)
    body.ground_down_m = -1.2
    flight = fly(body, limit_s=20.0, goal_down_m=-1.2, until_ground=False)
    assert flight[-1].command.touchdown
    assert body.touch_speed_m_s < 0.7


def test_a_fast_entry_does_not_overshoot_the_goal() -> None:
    flight = fly(entry(2.0, 0.0, 3.0, speed_m_s=3.0))
    assert max(float(s.state.pos_ned_m[0] - GOAL_NED_M[0]) for s in flight) < 0.1
