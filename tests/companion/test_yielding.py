"""A vehicle that gives way stands before anything can touch it, steps aside in time, and else does as planned."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.types import F64, VehicleState
from companion.guidance.yielding import Hull, Moving, YieldParams, give_way, setpoint

PARAMS = YieldParams(ahead_s=3.0, weight_m=10.0)
DODGING = dataclasses.replace(PARAMS, dodge=True)
HULL = Hull(0.33, 2.0, 0.04)
MOVER_M = 0.4
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
NOTHING = np.empty((0, 2))
TICK_S = 0.02
PLACE, SPEED = st.floats(-4.0, 4.0), st.floats(-1.5, 1.5)


def state(pos: F64 | tuple[float, float] = (0.0, 0.0), vel: F64 | tuple[float, float] = (0.0, 0.0)) -> VehicleState:
    return VehicleState(0.0, np.array([*pos, -2.5]), np.array([*vel, 0.0]), LEVEL, np.zeros(3))


def movers(*rows: tuple[float, float, float, float], doubt: float = 0.3) -> Moving:
    table = np.array(rows).reshape(-1, 4)
    return Moving(table[:, :2], table[:, 2:], np.full(len(table), doubt), MOVER_M)


def chosen(
    moving: Moving,
    vel: tuple[float, float] = (0.0, 0.0),
    wanted: tuple[float, float] = (0.0, 0.0),
    static: F64 = NOTHING,
    params: YieldParams = PARAMS,
) -> F64:
    """The velocity that is asked for in the end."""
    other = give_way(state(vel=vel), np.array(wanted), moving, static, HULL, params)
    return np.array(wanted) if other is None else other


def test_what_passes_far_away_changes_nothing() -> None:
    assert (
        give_way(state(vel=(1.0, 0.0)), np.array([1.5, 0.0]), movers((3.5, 3.0, 0.0, 1.0)), NOTHING, HULL, PARAMS)
        is None
    )


def test_a_vehicle_that_stands_steps_aside_for_what_comes_at_it() -> None:
    asked = chosen(movers((2.8, 0.2, -1.0, 0.0)))
    assert math.hypot(*asked) > 0.3


def test_on_its_way_it_slows_or_turns_for_what_would_meet_it() -> None:
    asked = chosen(movers((3.0, -2.4, 0.0, 1.2)), vel=(1.2, 0.0), wanted=(1.5, 0.0))
    assert not np.array_equal(asked, [1.5, 0.0])


def test_too_late_for_anything_else_it_brakes() -> None:
    assert chosen(movers((1.3, 0.0, -1.5, 0.0)), vel=(1.5, 0.0), wanted=(1.5, 0.0)).tolist() == [0.0, 0.0]


def test_it_never_steps_aside_into_what_stands() -> None:
    post = np.array([[0.0, side * 0.6] for side in (-1.0, 1.0)])
    asked = chosen(movers((2.6, 0.0, -0.8, 0.0)), static=post)
    assert abs(asked[1]) < abs(asked[0]) + 1e-9


@pytest.mark.parametrize("broken", [math.nan, math.inf])
def test_what_is_not_known_is_braked_for(broken: float) -> None:
    moving = movers((3.0, 3.0, 0.0, 0.0))
    for where in (state((broken, 0.0)), state(vel=(0.0, broken))):
        assert give_way(where, np.ones(2), moving, NOTHING, HULL, PARAMS).tolist() == [0.0, 0.0]  # type: ignore[union-attr]
    assert give_way(state(), np.array([broken, 0.0]), moving, NOTHING, HULL, PARAMS).tolist() == [0.0, 0.0]  # type: ignore[union-attr]


@given(
    st.lists(st.tuples(PLACE, PLACE, SPEED, SPEED), min_size=1, max_size=4),
    st.tuples(SPEED, SPEED),
    st.tuples(SPEED, SPEED),
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
)
@settings(max_examples=150, deadline=None)
def test_passive_safety_what_touches_it_touches_a_vehicle_that_stands(rows, vel, wanted, turns) -> None:
    """Flown for one step and braked from: whatever share of its speed, forth or back, each thing goes on with."""
    outside = [row for row in rows if math.hypot(row[0], row[1]) > HULL.radius_m + MOVER_M + PARAMS.room_m + 0.02]
    moving = movers(*outside, doubt=0.0)
    if not outside:
        return
    asked = chosen(moving, vel, wanted)
    if not asked.any():
        return  # brakes already: nothing better is to be had
    pos, speed = np.zeros(2), np.array(vel)
    for k in range(200):
        t_s = TICK_S * k
        if math.hypot(*speed) < 1e-9 and t_s > PARAMS.lag_s + HULL.step_s:
            return
        for (n, e, vn, ve), turn in zip(outside, turns, strict=False):
            assert math.hypot(n + turn * vn * t_s - pos[0], e + turn * ve * t_s - pos[1]) > HULL.radius_m + MOVER_M
        pos = pos + speed * TICK_S
        if t_s >= PARAMS.lag_s:
            aim = asked if t_s < PARAMS.lag_s + HULL.step_s else np.zeros(2)
            change = aim - speed
            speed = speed + change * min(1.0, PARAMS.acc_m_s2 * TICK_S / max(math.hypot(*change), 1e-12))


def test_what_comes_too_near_to_stand_for_is_dodged_where_there_is_room() -> None:
    near = movers((1.2, 0.3, -1.0, 0.0))
    assert chosen(near).tolist() == [0.0, 0.0]
    aside = chosen(near, params=DODGING)
    assert aside[0] < -0.5 and aside[1] < -0.3
    walls = np.array([[north / 4, side * 0.5] for north in range(-12, 4) for side in (-1, 1)])
    straight_back = chosen(near, static=walls, params=DODGING)
    assert straight_back[0] < -0.5 and abs(straight_back[1]) < 1e-6


@given(
    st.lists(st.tuples(PLACE, PLACE, SPEED, SPEED), min_size=1, max_size=4),
    st.tuples(SPEED, SPEED),
    st.tuples(SPEED, SPEED),
)
@settings(max_examples=150, deadline=None)
def test_a_dodge_keeps_clear_of_everything_that_goes_on_as_now(rows, vel, wanted) -> None:
    moving = movers(*rows)
    asked = chosen(moving, vel, wanted, params=DODGING)
    if chosen(moving, vel, wanted).any() or not asked.any():
        return  # not a dodge
    pos, speed = np.zeros(2), np.array(vel)
    for k in range(1, int(1.5 / TICK_S)):
        if TICK_S * k > PARAMS.lag_s:
            change = asked - speed
            speed = speed + change * min(1.0, PARAMS.acc_m_s2 * TICK_S / max(math.hypot(*change), 1e-12))
        pos = pos + speed * TICK_S
        away = [math.dist((n + vn * TICK_S * k, e + ve * TICK_S * k), pos) for n, e, vn, ve in rows]
        assert min(away) > HULL.radius_m + MOVER_M - 0.05  # looked at every 0.125 s


@given(st.tuples(SPEED, SPEED), st.tuples(SPEED, SPEED))
def test_the_setpoint_asks_for_that_velocity_from_where_the_vehicle_is(vel, asked) -> None:
    here = state((3.0, -2.0), vel)
    sent = setpoint(here, np.array(asked), -2.0, 0.5, PARAMS)
    assert sent.pos_ned_m is not None and sent.vel_ned_m_s is not None and sent.acc_ned_m_s2 is not None
    assert sent.pos_ned_m.tolist() == [3.0, -2.0, -2.0] and sent.vel_ned_m_s.tolist() == [*asked, 0.0]
    assert math.hypot(*sent.acc_ned_m_s2) <= PARAMS.acc_m_s2 + 1e-9


@given(st.lists(st.tuples(PLACE, PLACE, SPEED, SPEED), min_size=1, max_size=4), st.tuples(SPEED, SPEED))
@settings(max_examples=60, deadline=None)
def test_more_doubt_never_allows_more(rows, vel) -> None:
    sure, unsure = movers(*rows, doubt=0.0), movers(*rows, doubt=1.0)
    wanted, free = np.array([1.0, 0.0]), dataclasses.replace(PARAMS, weight_m=0.0)
    if give_way(state(vel=vel), wanted, unsure, NOTHING, HULL, free) is None:
        assert give_way(state(vel=vel), wanted, sure, NOTHING, HULL, free) is None
