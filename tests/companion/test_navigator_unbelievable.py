"""Nothing that arrives makes the navigator raise, ask for something that is no number, or lose its map."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene import CLUTTER, DOWN_M, FLYING, HOVERING, Eye, Pilot, world

from companion import navigator
from companion.core.frames import quaternion
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import Setpoint
from companion.navigator import Memory, Params

TRUNKS = Eye(world(CLUTTER))
GOALS = {"standby": 30.0, "travel": 30.0, "rl": 30.0, "landing": 0.5}
PARAMS = Params()
BAD = (math.nan, math.inf, -math.inf, 1e30)
SIZES = {"pos_ned_m": 3, "vel_ned_m_s": 3, "rates_frd_rad_s": 3, "q_ned_frd": 4}
FIELDS = [(name, k) for name, size in SIZES.items() for k in range(size)]
ANY = st.floats(allow_nan=True, allow_infinity=True)


@functools.cache
def before(mode: str) -> tuple[Memory, Task, float]:
    """A memory in that mode, its task, and its time."""
    eye = Eye(world()) if mode in ("travel", "landing") else TRUNKS
    pilot = Pilot(eye, Task(np.array([GOALS[mode], 0.0]), None, 3.0))
    records = pilot.ticks(5, status=HOVERING) if mode == "standby" else pilot.ticks(40)
    assert records[-1].mode == mode
    return pilot.memory, pilot.task, pilot.t_s


def spoilt(inputs: Inputs, field: str, index: int, value: float) -> Inputs:
    array = getattr(inputs.state, field).copy()
    array[index] = value
    return dataclasses.replace(inputs, state=dataclasses.replace(inputs.state, **{field: array}))


def is_number(setpoint: Setpoint) -> bool:
    parts = (setpoint.pos_ned_m, setpoint.vel_ned_m_s, setpoint.acc_ned_m_s2)
    values = [value for part in parts if part is not None for value in part.tolist()]
    values += [setpoint.t_s, 0.0 if setpoint.yaw_rad is None else setpoint.yaw_rad]
    return all(map(math.isfinite, values))


def map_is_sound(memory: Memory) -> bool:
    grid = memory.grid
    return all(np.isfinite(cells).all() for cells in (grid.free_t, grid.hit_t, grid.hit_ne_m))


@pytest.mark.parametrize("mode", GOALS)
def test_a_state_that_is_no_number_is_answered_with_a_hold_and_leaves_no_trace(mode: str) -> None:
    memory, task, t_s = before(mode)
    status = HOVERING if mode == "standby" else FLYING
    fine = TRUNKS.inputs(t_s + 0.04, vel_ned_m_s=(0.5, 0.0, 0.0), status=status)
    for field, index in FIELDS:
        for value in BAD:
            after, setpoint, record = navigator.tick(memory, spoilt(fine, field, index, value), task, PARAMS)
            assert is_number(setpoint), (field, index, value)
            assert setpoint.t_s == fine.scan.t_s
            assert record.mode == ("standby" if mode == "standby" else "hold")
            assert setpoint.pos_ned_m == pytest.approx([0.0, 0.0, DOWN_M])  # the last good place
            assert after.grid.hit_t.tobytes() == memory.grid.hit_t.tobytes()
            assert record.as_dict()["fresh"] is False
            _, setpoint, record = navigator.tick(after, TRUNKS.inputs(t_s + 0.08), task, PARAMS)
            assert is_number(setpoint)
            assert record.mode != "hold"


@pytest.mark.parametrize("mode", GOALS)
@pytest.mark.parametrize("value", BAD[:3])
def test_a_time_that_is_no_number_does_no_harm(mode: str, value: float) -> None:
    memory, task, t_s = before(mode)
    fine = TRUNKS.inputs(t_s + 0.04)
    state, scan = dataclasses.replace(fine.state, t_s=value), dataclasses.replace(fine.scan, t_s=value)
    for inputs in (
        dataclasses.replace(fine, state=state),
        dataclasses.replace(fine, scan=scan),
        dataclasses.replace(fine, state=state, scan=scan),
    ):
        after, setpoint, _ = navigator.tick(memory, inputs, task, PARAMS)
        assert is_number(setpoint)
        assert map_is_sound(after)


def test_in_offboard_before_anything_good_was_heard_it_asks_to_stay() -> None:
    nothing = spoilt(TRUNKS.inputs(1.0), "pos_ned_m", 0, math.nan)
    memory, setpoint, record = navigator.tick(navigator.start(PARAMS), nothing, before("rl")[1], PARAMS)
    assert (setpoint.pos_ned_m, setpoint.acc_ned_m_s2, setpoint.yaw_rad) == (None, None, None)
    assert setpoint.vel_ned_m_s.tolist() == [0.0, 0.0, 0.0]
    assert (record.mode, memory.engaged) == ("standby", None)
    memory, _, record = navigator.tick(memory, TRUNKS.inputs(1.04), before("rl")[1], PARAMS)
    assert memory.engaged is not None and memory.engaged.down_m == DOWN_M


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(sorted(GOALS)),
    st.lists(st.tuples(st.sampled_from(FIELDS), ANY), max_size=4),
    st.lists(st.tuples(st.integers(0, 71), ANY), max_size=6),
    st.booleans(),
)
def test_whatever_arrives_the_answer_is_a_setpoint(mode, state, ranges, fresh) -> None:
    memory, task, t_s = before(mode)
    inputs = TRUNKS.inputs(t_s + 0.04, fresh=fresh)
    for (field, index), value in state:
        inputs = spoilt(inputs, field, index, value)
    range_m = inputs.scan.range_m.copy()
    for index, value in ranges:
        range_m[index] = value
    inputs = dataclasses.replace(inputs, scan=dataclasses.replace(inputs.scan, range_m=range_m))
    after, setpoint, _ = navigator.tick(memory, inputs, task, PARAMS)
    assert is_number(setpoint)
    assert map_is_sound(after)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(GOALS)), *[st.floats(-math.pi, math.pi)] * 3)
def test_any_attitude_is_flown_from(mode: str, roll: float, pitch: float, yaw: float) -> None:
    memory, task, t_s = before(mode)
    inputs = TRUNKS.inputs(t_s + 0.04)
    tumbled = dataclasses.replace(inputs.state, q_ned_frd=quaternion(roll, pitch, yaw))
    after, setpoint, _ = navigator.tick(memory, dataclasses.replace(inputs, state=tumbled), task, PARAMS)
    assert is_number(setpoint)
    assert map_is_sound(after)


@pytest.mark.parametrize("value", [math.nan, math.inf, 0.0, -1.0])
def test_a_scan_that_says_one_thing_everywhere_is_survived(value: float) -> None:
    for mode in GOALS:
        memory, task, t_s = before(mode)
        inputs = TRUNKS.inputs(t_s + 0.04)
        scan = dataclasses.replace(inputs.scan, range_m=np.full(72, value))
        after, setpoint, _ = navigator.tick(memory, dataclasses.replace(inputs, scan=scan), task, PARAMS)
        assert is_number(setpoint)
        assert map_is_sound(after)
