"""What one tick answers: standby, engagement, Hold, no path, landing and its abort. Local ned is the scene's own."""

import dataclasses
import math

import numpy as np
import pytest
from scene import CLUTTER, DOWN_M, DT_S, FLYING, HOVERING, PARAMS, Eye, Pilot, ring, world

from companion.checker.checker import VerdictKind
from companion.core.task import Task
from companion.core.types import LandedState, NavMode
from companion.navigator import Record

STANDING = dataclasses.replace(HOVERING, armed=False, landed=LandedState.ON_GROUND)
OPEN = world()
GOAL = Task(np.array([30.0, 0.0]), None, 3.0)
HERE = Task(np.array([0.5, 0.0]), None, 3.0)
TRUNKS = world(CLUTTER)
CAGE = ring(0.45)  # not even an escape of a few centimetres


def travelling() -> Pilot:
    pilot = Pilot(Eye(OPEN), GOAL)
    pilot.ticks(5, status=HOVERING)
    pilot.ticks(5)
    return pilot


def in_rl() -> tuple[Pilot, Record]:
    """Standing in front of trunks until RL mode has an accepted path."""
    pilot = Pilot(Eye(TRUNKS), GOAL)
    records = pilot.ticks(40)
    assert records[-1].mode == NavMode.RL
    assert records[-1].memory.engaged is not None and records[-1].memory.engaged.path is not None
    return pilot, records[-1]


def landing() -> tuple[Pilot, Record]:
    pilot = Pilot(Eye(OPEN), HERE)
    record = pilot.ticks(40)[-1]
    assert record.mode == NavMode.LANDING
    return pilot, record


@pytest.mark.parametrize("status", [HOVERING, dataclasses.replace(FLYING, armed=False)])
def test_until_it_may_fly_it_answers_with_where_the_vehicle_is(status) -> None:
    pilot = Pilot(Eye(TRUNKS), GOAL)
    for k in range(20):
        pos = (0.1 * k, -0.05 * k, -2.0)
        record = pilot.tick(pos_ned_m=pos, vel_ned_m_s=(2.5, 0.0, 0.0), yaw_rad=0.02 * k, status=status)
        assert record.mode == "standby"
        assert record.setpoint.t_s == record.inputs.scan.t_s
        assert record.setpoint.pos_ned_m.tolist() == list(pos)
        assert (record.setpoint.vel_ned_m_s, record.setpoint.acc_ned_m_s2) == (None, None)
        assert record.setpoint.yaw_rad == pytest.approx(0.02 * k)
        assert (record.memory.engaged, record.decision) == (None, None)


def test_what_was_seen_while_the_motors_were_off_is_forgotten() -> None:
    pilot = Pilot(Eye(TRUNKS), GOAL)  # by an autopilot that does not know yet where it is
    seen = pilot.ticks(20, status=STANDING)[-1]
    pilot.eye = Eye(OPEN)
    assert len(seen.percept.static_ne_m) > 0
    assert len(pilot.tick(status=HOVERING).percept.static_ne_m) == 0


def test_who_took_the_vehicle_back_finds_neither_policy_nor_guard_with_an_old_way() -> None:
    pilot, _ = in_rl()
    pilot.memory = dataclasses.replace(pilot.memory, policy=np.zeros(3), guard=np.zeros((2, 2)))
    memory = pilot.tick(status=HOVERING).memory
    assert (memory.policy, memory.guard) == (None, None)


@pytest.mark.parametrize("ground_down_m", [-1.2, -0.5, 0.0, 0.7])
def test_the_ground_is_where_the_vehicle_last_stood(ground_down_m: float) -> None:
    pilot = Pilot(Eye(OPEN), GOAL)
    pilot.ticks(3, status=STANDING, pos_ned_m=(0.0, 0.0, ground_down_m))
    record = pilot.tick(pos_ned_m=(0.0, 0.0, ground_down_m - 2.0))
    assert record.memory.ground_down_m == ground_down_m
    pilot = Pilot(Eye(OPEN), HERE)
    pilot.ticks(3, status=STANDING, pos_ned_m=(0.0, 0.0, ground_down_m))
    engaged = pilot.ticks(40, pos_ned_m=(0.0, 0.0, ground_down_m - 2.0))[-1].memory.engaged
    assert engaged is not None and engaged.landing is not None
    assert engaged.landing.goal_down_m == ground_down_m


def test_it_looks_round_before_it_may_fly() -> None:
    pilot = Pilot(Eye(TRUNKS), GOAL)
    assert len(pilot.ticks(5, status=HOVERING)[-1].percept.static_ne_m) > 0


def test_the_first_tick_in_offboard_freezes_line_and_altitude() -> None:
    pilot = Pilot(Eye(OPEN), GOAL)
    pilot.ticks(3, status=HOVERING, pos_ned_m=(-3.0, 5.0, -9.0))
    first = pilot.tick(pos_ned_m=(1.0, 2.0, -3.25)).memory.engaged
    later = [pilot.tick(pos_ned_m=(1.0 + 0.1 * k, 2.5, -3.1)).memory.engaged for k in range(10)]
    assert first is not None
    assert first.start_ne_m.tolist() == [1.0, 2.0]
    assert first.line.origin_ned_m.tolist() == [1.0, 2.0]
    assert first.line.goal_ned_m.tolist() == GOAL.goal_ned_m.tolist()
    assert first.down_m == -3.25
    for engaged in later:
        assert engaged is not None
        assert engaged.line is first.line
        assert (engaged.down_m, engaged.engaged_t_s) == (first.down_m, first.engaged_t_s)
    assert pilot.tick(pos_ned_m=(2.0, 2.5, -3.1)).setpoint.pos_ned_m[2] == -3.25


def test_an_altitude_of_the_task_goes_before_that_of_the_first_tick() -> None:
    pilot = Pilot(Eye(OPEN), dataclasses.replace(GOAL, down_m=-4.0))
    assert pilot.tick(pos_ned_m=(0.0, 0.0, -2.0)).setpoint.pos_ned_m[2] == -4.0


def test_a_pilot_who_takes_over_and_gives_back_starts_a_new_engagement() -> None:
    pilot = travelling()
    pilot.ticks(3, status=HOVERING, pos_ned_m=(4.0, 4.0, -5.0))
    assert pilot.memory.engaged is None
    engaged = pilot.tick(pos_ned_m=(4.0, 4.0, -5.0)).memory.engaged
    assert engaged is not None
    assert (engaged.start_ne_m.tolist(), engaged.down_m) == ([4.0, 4.0], -5.0)


def test_travel_flies_the_line_at_no_more_than_cruise() -> None:
    pilot = travelling()
    for k in range(50):
        record = pilot.tick(pos_ned_m=(0.1 * k, 0.2, DOWN_M), vel_ned_m_s=(2.5, 0.0, 0.0))
        assert record.mode == NavMode.TRAVEL
        north, east = record.setpoint.vel_ned_m_s[:2]
        assert 0.0 < north <= math.hypot(north, east) <= GOAL.cruise_m_s + 1e-9
        assert east < 0.0  # back to the line


@pytest.mark.parametrize(("speed_m_s", "ramped"), [(2.0, True), (3.5, False)])
def test_stale_inputs_brake_hold_and_go_on_when_fresh_again(speed_m_s: float, ramped: bool) -> None:
    pilot = travelling()
    fast = (speed_m_s, 0.0, 0.0)
    before = pilot.tick(pos_ned_m=(1.0, 0.0, DOWN_M), vel_ned_m_s=fast)
    held = pilot.ticks(30, pos_ned_m=(1.1, 0.0, DOWN_M), vel_ned_m_s=fast, fresh=False)
    after = pilot.tick(pos_ned_m=(1.5, 0.0, DOWN_M))
    assert {record.mode for record in held} == {"hold"}
    assert [record.memory.engaged.arbiter.hold_count for record in held] == [1] * 30
    speeds = [float(record.setpoint.vel_ned_m_s[0]) for record in held]
    if ramped:
        assert speeds[0] == speed_m_s
        assert speeds == sorted(speeds, reverse=True)
        assert held[0].setpoint.acc_ned_m_s2[0] < 0.0
        stop_m = 1.1 + speed_m_s**2 / (2 * PARAMS.limits.ramp_m_s2)
        assert held[-1].setpoint.pos_ned_m[0] == pytest.approx(stop_m)
    else:
        assert {tuple(record.setpoint.pos_ned_m) for record in held} == {(1.1, 0.0, DOWN_M)}
    assert speeds[-1] == 0.0
    assert (before.mode, after.mode) == (NavMode.TRAVEL, NavMode.TRAVEL)
    assert after.memory.engaged.stop is None
    assert after.setpoint.vel_ned_m_s[0] > 0.0
    assert after.memory.engaged.arbiter.switches == before.memory.engaged.arbiter.switches


def test_a_path_outlasts_a_hold() -> None:
    pilot, record = in_rl()
    pilot.ticks(2, fresh=False)
    after = pilot.tick()
    assert after.mode == NavMode.RL
    assert after.memory.engaged.path is not None
    assert after.memory.engaged.path.decided_t_s >= record.memory.engaged.path.decided_t_s


def test_with_no_way_out_it_holds_where_it_is_and_keeps_asking() -> None:
    pilot = Pilot(Eye(world(CAGE)), GOAL)
    records = pilot.ticks(80)
    enclosed = [record for record in records if record.mode == NavMode.RL]
    asked = [record for record in enclosed if record.decision is not None]
    assert {record.decision.verdict.kind for record in asked} == {VerdictKind.REFUSED}
    assert all(record.memory.engaged.path is None for record in enclosed)
    assert {tuple(record.setpoint.pos_ned_m) for record in enclosed} == {(0.0, 0.0, DOWN_M)}
    assert all(not record.setpoint.vel_ned_m_s.any() for record in enclosed)
    gaps = np.diff([record.inputs.scan.t_s for record in asked])
    assert len(asked) > 5
    assert gaps == pytest.approx(PARAMS.policy.retry_s, abs=DT_S + 1e-9)


def test_the_course_of_the_last_accepted_path_outlasts_it() -> None:
    pilot, record = in_rl()
    end = record.memory.engaged.path.vertices_ne_m[-1]
    course_rad = record.memory.engaged.course_rad
    assert course_rad == pytest.approx(math.atan2(end[1], end[0]), abs=0.1)  # it stands where the path begins
    pilot.eye = Eye(world(CAGE))
    caged = pilot.ticks(30)[-1].memory.engaged
    assert caged.path is None and abs(caged.course_rad) <= math.pi


def test_a_path_that_vanishes_in_flight_is_braked_for() -> None:
    pilot, _ = in_rl()
    pilot.eye = Eye(world(CAGE))
    moving = pilot.ticks(12, vel_ned_m_s=(1.5, 0.0, 0.0))[-1]
    assert moving.memory.engaged.path is None
    assert moving.memory.engaged.stop is not None
    speeds = [float(pilot.tick().setpoint.vel_ned_m_s[0]) for _ in range(12)]
    assert speeds[-1] == 0.0
    assert speeds == sorted(speeds, reverse=True)


def test_going_on_into_something_remembered_is_braked_for_before_any_plan() -> None:
    pilot = Pilot(Eye(world([(2.0, 0.0, 0.3)])), GOAL)
    pilot.ticks(5, status=HOVERING)
    record = pilot.tick(vel_ned_m_s=(3.0, 0.0, 0.0))
    assert record.memory.engaged.stop is not None
    assert record.setpoint.pos_ned_m.tolist() == [0.0, 0.0, DOWN_M]
    assert record.tracked is None


def test_landing_descends_over_a_free_goal() -> None:
    pilot, first = landing()
    downs = [float(pilot.tick(pos_ned_m=(0.5, 0.0, DOWN_M)).setpoint.pos_ned_m[2]) for _ in range(20)]
    assert downs[-1] > first.setpoint.pos_ned_m[2]
    assert downs == sorted(downs)


def test_a_landing_turned_unsafe_pauses_at_once_aborts_to_rl_and_lands_again_when_it_is_safe() -> None:
    pilot, _ = landing()
    over_goal = {"pos_ned_m": (0.5, 0.0, DOWN_M)}
    sinking = pilot.ticks(10, **over_goal)[-1]
    assert sinking.setpoint.vel_ned_m_s[2] > 0.0
    pilot.eye = Eye(world([(0.5, 1.0, 0.4)]))  # surface 0.6 m from the vehicle: nearer than d_abort
    unsafe = pilot.ticks(10, **over_goal)
    assert unsafe[0].mode == NavMode.LANDING  # not yet debounced
    assert unsafe[0].setpoint.vel_ned_m_s[2] == 0.0
    assert unsafe[0].setpoint.pos_ned_m[2] == sinking.setpoint.pos_ned_m[2]
    modes = [record.mode for record in unsafe]
    assert modes == [NavMode.LANDING] * 4 + [NavMode.RL] * 6
    arbiter = unsafe[-1].memory.engaged.arbiter
    assert (arbiter.aborts, unsafe[-1].memory.engaged.landing) == (1, None)
    pilot.eye = Eye(OPEN)
    again = pilot.ticks(40, **over_goal)
    assert again[-1].mode == NavMode.LANDING
    back = next(k for k, record in enumerate(again) if record.mode == NavMode.LANDING)
    assert (back + 6) * DT_S >= PARAMS.arbiter.dwell_s - 1e-9  # the way back obeys the dwell
    assert again[-1].setpoint.vel_ned_m_s[2] > 0.0
    assert again[-1].memory.engaged.arbiter.switches <= again[-1].switches_bound
