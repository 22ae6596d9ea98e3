"""Does the arbiter do the right thing in every mode, for every class of facts, at every stage of its clocks?"""

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest

from companion.arbiter import arbiter
from companion.arbiter.arbiter import ArbiterState
from companion.arbiter.facts import ArbiterParams, Facts, thresholds
from companion.core.types import NavMode

PARAMS = ArbiterParams(
    d_enter_m=3.0, d_exit_m=3.5, s_enter=0.85, s_exit=0.88, s_land=0.3, s_abort=0.2, d_land_m=1.0, d_abort_m=0.7,
    land_in_m=2.0, land_out_m=3.0, debounce_ticks=5, debounce_s=0.2, dwell_s=1.0,
)  # fmt: skip  # the defaults may be tuned, the rules may not
LIMITS = thresholds(PARAMS)
TICK_S = 0.04
NAN = math.nan

# One value per class, and the classes of each: (RL trigger, recovered, may land, may go on landing).
D_CLASSES = {
    0.5: (True, False, False, False),
    0.85: (True, False, False, True),
    2.0: (True, False, True, True),
    3.2: (False, False, True, True),
    5.0: (False, True, True, True),
    math.inf: (False, True, True, True),
}
S_CLASSES = {
    0.1: (True, False, False, False),
    0.25: (True, False, False, True),
    0.5: (True, False, True, True),
    0.86: (False, False, True, True),
    0.95: (False, True, True, True),
}
DISTANCES_M = (1.0, 2.5, 5.0, NAN)  # in, between in and out, out, unknown
MODES = tuple(NavMode)
BOOLS = (False, True)


def every_fact() -> list[Facts]:
    return [
        Facts(TICK_S, distance_m, d_m, s, sight, line_done, True)
        for distance_m, d_m, s, sight, line_done in itertools.product(
            DISTANCES_M, (*D_CLASSES, NAN), (*S_CLASSES, NAN), BOOLS, BOOLS
        )
    ]


def every_state() -> list[ArbiterState]:
    """Modes x dwell unfinished, about to finish, finished x wishes fresh, about to mature, mature."""
    stages = ((0, 0.0), (1, 0.04), (4, 0.16), (5, 0.1), (3, 0.5), (9, 0.36))
    return [
        ArbiterState(0.0, mode, mode_s, wish, *(stage if wish else (0, 0.0)), switches=7, aborts=2, hold_count=3)
        for mode, mode_s, wish, stage in itertools.product(MODES, (0.0, 0.9, 0.96, 5.0), (None, *MODES), stages)
        if wish != mode
    ]


def expected_wish(mode: NavMode, facts: Facts) -> tuple[NavMode, bool]:
    """The rules once more, as a table over classes."""
    known = not any(math.isnan(v) for v in (facts.d_min_m, facts.s_fuzzy, facts.goal_distance_m))
    if not known:
        return NavMode.RL, mode == NavMode.LANDING
    both = zip(D_CLASSES[facts.d_min_m], S_CLASSES[facts.s_fuzzy], strict=True)
    trigger, recovered, land, stay = (d and s for d, s in both)
    resume = recovered and facts.line_of_sight
    near = facts.goal_distance_m == 1.0 or (facts.goal_distance_m == 2.5 and facts.line_done)
    if mode == NavMode.LANDING:
        if stay and facts.goal_distance_m != 5.0:
            return NavMode.LANDING, False
        return (NavMode.TRAVEL if stay and resume else NavMode.RL), not stay
    if near and land:
        return NavMode.LANDING, False
    if mode == NavMode.RL:
        return (NavMode.TRAVEL if resume else NavMode.RL), False
    return (NavMode.RL if trigger else NavMode.TRAVEL), False


def test_every_mode_and_fact_wishes_what_the_table_says() -> None:
    for mode, facts in itertools.product(MODES, every_fact()):
        wish = arbiter.wish_of(mode, facts, LIMITS)
        assert (wish.mode, wish.abort) == expected_wish(mode, facts), (mode, facts)


def test_every_state_and_fact_moves_as_the_rules_say() -> None:
    for state, facts in itertools.product(every_state(), every_fact()):
        wish, abort = expected_wish(state.mode, facts)
        after = arbiter.decide(state, facts, LIMITS, PARAMS)
        ticks = state.wish_ticks + 1 if wish == state.wish else 1
        seconds = state.wish_s + TICK_S if wish == state.wish else TICK_S
        matured = ticks >= 5 and seconds > 0.1999
        dwelt = state.mode_s + TICK_S > 0.9999
        switches = wish != state.mode and matured and (dwelt or abort)
        if switches:
            assert after == ArbiterState(TICK_S, wish, switches=8, aborts=2 + abort, hold_count=3), (state, facts)
        elif wish == state.mode:
            assert (after.mode, after.wish, after.wish_ticks, after.wish_s) == (state.mode, None, 0, 0.0)
            assert (after.switches, after.aborts) == (7, 2)
        else:
            assert (after.mode, after.wish, after.wish_ticks) == (state.mode, wish, ticks), (state, facts)
            assert (after.switches, after.aborts) == (7, 2)


def test_hold_freezes_every_state_under_every_fact() -> None:
    some_facts = every_fact()[::17]
    for state, facts in itertools.product(every_state(), some_facts):
        held = arbiter.decide(state, replace(facts, fresh=False, t_s=60.0), LIMITS, PARAMS)
        assert held == replace(state, t_s=60.0, hold=True, hold_count=4)
        again = arbiter.decide(held, replace(facts, fresh=False, t_s=NAN), LIMITS, PARAMS)
        assert again == held


def test_abort_is_reached_from_every_landing_state_within_the_debounce() -> None:
    unsafe = [f for f in every_fact() if expected_wish(NavMode.LANDING, f)[1]]
    assert len(unsafe) > 100
    for state, held in itertools.product(every_state(), BOOLS):
        if state.mode != NavMode.LANDING:
            continue
        for facts in unsafe[::7]:
            now = replace(state, hold=held)
            for tick in range(1, PARAMS.debounce_ticks + 1 + held):
                now = arbiter.decide(now, replace(facts, t_s=tick * TICK_S), LIMITS, PARAMS)
            assert now.mode == NavMode.RL, (state, facts)
            assert now.aborts == 3


@pytest.mark.parametrize(
    ("mode", "changed", "wish"),
    [
        # exactly at a threshold nothing begins: the inequalities of the paper are strict
        (NavMode.TRAVEL, {"d_min_m": 3.0, "s_fuzzy": 0.5}, NavMode.TRAVEL),
        (NavMode.TRAVEL, {"d_min_m": 2.0, "s_fuzzy": 0.85}, NavMode.TRAVEL),
        (NavMode.TRAVEL, {"d_min_m": 2.999, "s_fuzzy": 0.849}, NavMode.RL),
        (NavMode.RL, {"d_min_m": 3.5}, NavMode.RL),
        (NavMode.RL, {"s_fuzzy": 0.88}, NavMode.RL),
        (NavMode.RL, {"d_min_m": 3.501, "s_fuzzy": 0.881}, NavMode.TRAVEL),
        (NavMode.RL, {"goal_distance_m": 2.0, "line_of_sight": False}, NavMode.RL),
        (NavMode.RL, {"goal_distance_m": 1.999, "line_of_sight": False}, NavMode.LANDING),
        (NavMode.RL, {"goal_distance_m": 1.0, "d_min_m": 1.0}, NavMode.RL),
        (NavMode.RL, {"goal_distance_m": 1.0, "s_fuzzy": 0.3}, NavMode.RL),
        (NavMode.TRAVEL, {"goal_distance_m": 3.0, "line_done": True}, NavMode.TRAVEL),
        (NavMode.TRAVEL, {"goal_distance_m": 2.999, "line_done": True}, NavMode.LANDING),
        (NavMode.LANDING, {"goal_distance_m": 3.0}, NavMode.LANDING),
        (NavMode.LANDING, {"goal_distance_m": 3.001}, NavMode.TRAVEL),
        (NavMode.LANDING, {"goal_distance_m": 3.001, "line_of_sight": False}, NavMode.RL),
        (NavMode.LANDING, {"goal_distance_m": 1.0, "d_min_m": 0.7}, NavMode.RL),
        (NavMode.LANDING, {"goal_distance_m": 1.0, "s_fuzzy": 0.2}, NavMode.RL),
        (NavMode.LANDING, {"goal_distance_m": 1.0, "d_min_m": 0.701, "s_fuzzy": 0.201}, NavMode.LANDING),
    ],
)
def test_thresholds_are_strict(mode: NavMode, changed: dict[str, Any], wish: NavMode) -> None:
    open_field = Facts(0.0, 20.0, math.inf, 1.0, True, False, True)
    assert arbiter.wish_of(mode, replace(open_field, **changed), LIMITS).mode == wish
