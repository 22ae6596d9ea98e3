"""Do the arbiter's promises hold over whole flights: switch bound, line of sight, Hold, odd clocks?"""

import itertools
import math
from dataclasses import fields, replace
from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.arbiter import arbiter
from companion.arbiter.arbiter import ArbiterState
from companion.arbiter.facts import ArbiterParams, Facts, Thresholds, landing_safe, thresholds
from companion.core import params as core_params
from companion.core.params import ParamError
from companion.core.types import NavMode

TICK_MS = 40
PARAMS = ArbiterParams(
    d_enter_m=3.0, d_exit_m=3.5, s_enter=0.85, s_exit=0.88, s_land=0.3, s_abort=0.2, d_land_m=1.0, d_abort_m=0.7,
    land_in_m=2.0, land_out_m=3.0, debounce_ticks=5, debounce_s=0.2, dwell_s=1.0,
)  # fmt: skip  # the defaults may be tuned, the rules may not
OPEN = Facts(0.0, 20.0, math.inf, 1.0, True, False, True)
CLUTTER = replace(OPEN, d_min_m=1.5, s_fuzzy=0.5, line_of_sight=False)
NEAR_GOAL = replace(OPEN, goal_distance_m=1.0)
UNSAFE_GOAL = replace(NEAR_GOAL, d_min_m=0.5, s_fuzzy=0.1)

FACTS = st.builds(
    Facts,
    t_s=st.just(0.0),
    goal_distance_m=st.sampled_from([0.5, 1.9, 2.5, 5.0, 30.0, math.nan]),
    d_min_m=st.sampled_from([0.3, 0.8, 1.5, 3.2, 4.0, math.inf, math.nan]),
    s_fuzzy=st.sampled_from([0.1, 0.25, 0.5, 0.87, 0.95, math.nan]),
    line_of_sight=st.booleans(),
    line_done=st.booleans(),
    fresh=st.sampled_from([True, True, True, False]),
)
BLOCKS = st.tuples(FACTS, st.integers(1, 12), st.sampled_from([0, 1, 5, 40, 40, 40, 100, 700]))
SETTINGS = st.builds(
    partial(replace, PARAMS),
    debounce_ticks=st.integers(1, 6),
    debounce_s=st.sampled_from([0.0, 0.04, 0.2, 0.5]),
    dwell_s=st.sampled_from([0.0, 0.1, 0.2, 1.0]),
)


def run(state: ArbiterState, ticks: list[tuple[int, Facts]], params: ArbiterParams) -> list[ArbiterState]:
    """States after each (time in ms, facts)."""
    limits = thresholds(params)
    states = [state]
    for t_ms, facts in ticks:
        states.append(arbiter.decide(states[-1], replace(facts, t_s=t_ms / 1000), limits, params))
    return states[1:]


def timed(blocks: list[tuple[Facts, int, int]], start_ms: int = 0) -> list[tuple[int, Facts]]:
    now_ms, ticks = start_ms, []
    for facts, count, step_ms in blocks:
        for _ in range(count):
            now_ms += step_ms
            ticks.append((now_ms, facts))
    return ticks


def repeated(facts: Facts, count: int, after_ms: int = 0, step_ms: int = TICK_MS) -> list[tuple[int, Facts]]:
    return timed([(facts, count, step_ms)], after_ms)


def in_mode(mode: NavMode, mode_s: float = 100.0) -> ArbiterState:
    return ArbiterState(0.0, mode, mode_s)


def assert_bound(states: list[ArbiterState], params: ArbiterParams) -> None:
    events = [
        (now.t_s, now.aborts - before.aborts)
        for before, now in itertools.pairwise([arbiter.start(0.0), *states])
        if now.switches != before.switches
    ]
    for first, last in itertools.combinations_with_replacement(range(len(events)), 2):
        window_s = events[last][0] - events[first][0]
        aborts = sum(a for _, a in events[first : last + 1])
        count = last - first + 1
        bound = arbiter.switch_bound(window_s, params)
        assert count - aborts <= bound
        assert count <= arbiter.switch_bound(window_s, params, aborts) <= 2 * bound


@settings(max_examples=250, deadline=None)
@given(blocks=st.lists(BLOCKS, max_size=40), params=SETTINGS)
def test_no_sequence_of_facts_breaks_the_switch_bound(
    blocks: list[tuple[Facts, int, int]], params: ArbiterParams
) -> None:
    states = run(arbiter.start(0.0), timed(blocks), params)
    assert_bound(states, params)
    assert all(
        now.mode == before.mode or now.switches == before.switches + 1 for before, now in itertools.pairwise(states)
    )


def contrary(mode: NavMode, aborting: bool) -> Facts:
    """The facts that ask for another mode in every mode."""
    if aborting:
        return UNSAFE_GOAL if mode == NavMode.LANDING else NEAR_GOAL
    return OPEN if mode == NavMode.RL else CLUTTER


@pytest.mark.parametrize("aborting", [False, True])
@pytest.mark.parametrize(
    ("dwell_s", "ticks", "debounce_s", "spacing_s"), [(1.0, 5, 0.2, 1.0), (0.0, 5, 0.2, 0.2), (0.12, 10, 0.4, 0.4)]
)
def test_the_bound_is_exact_against_an_adversary(
    dwell_s: float, ticks: int, debounce_s: float, spacing_s: float, aborting: bool
) -> None:
    params = replace(PARAMS, dwell_s=dwell_s, debounce_ticks=ticks, debounce_s=debounce_s)
    states = [arbiter.start(0.0)]
    for tick in range(1, 1001):
        facts = replace(contrary(states[-1].mode, aborting), t_s=tick * TICK_MS / 1000)
        states.append(arbiter.decide(states[-1], facts, thresholds(params), params))
    assert_bound(states[1:], params)
    times = [b.t_s for a, b in itertools.pairwise(states) if b.switches != a.switches]
    if not aborting:
        assert len(times) == arbiter.switch_bound(times[-1] - times[0], params)
        assert times[0] == pytest.approx(spacing_s)
        assert all(b - a == pytest.approx(spacing_s) for a, b in itertools.pairwise(times))
    else:
        assert states[-1].aborts == states[-1].switches // 2
        assert all(
            b - a == pytest.approx(w)
            for (a, b), w in zip(itertools.pairwise(times), itertools.cycle([debounce_s, spacing_s]))
        )


@pytest.mark.parametrize(
    ("duration_s", "aborts", "bound"),
    [(0.0, 0, 1), (0.99, 0, 1), (1.0, 0, 2), (30.0, 0, 31), (30.0, 4, 35), (1.0, 9, 4), (0.1 + 0.2 + 0.7, 0, 2)],
)
def test_switch_bound_on_hand_worked_cases(duration_s: float, aborts: int, bound: int) -> None:
    assert arbiter.switch_bound(duration_s, PARAMS, aborts) == bound


def test_the_longer_of_dwell_and_debounce_spaces_the_switches() -> None:
    assert arbiter.switch_bound(3.0, replace(PARAMS, dwell_s=0.1, debounce_s=0.5)) == 7


@settings(max_examples=250, deadline=None)
@given(blocks=st.lists(BLOCKS, max_size=40), params=SETTINGS)
def test_travel_is_never_resumed_without_line_of_sight_and_a_recovered_score(
    blocks: list[tuple[Facts, int, int]], params: ArbiterParams
) -> None:
    ticks = timed(blocks)
    states = [arbiter.start(0.0), *run(arbiter.start(0.0), ticks, params)]
    for i, (before, now) in enumerate(itertools.pairwise(states)):
        if now.mode == NavMode.TRAVEL != before.mode:
            seen = [facts for _, facts in ticks[: i + 1] if facts.fresh][-params.debounce_ticks :]
            assert all(f.line_of_sight and f.s_fuzzy > params.s_exit and f.d_min_m > params.d_exit_m for f in seen)


@settings(max_examples=100, deadline=None)
@given(
    before=st.lists(BLOCKS, max_size=12),
    held=st.lists(BLOCKS, min_size=1, max_size=4),
    after=st.lists(BLOCKS, min_size=1, max_size=12),
)
def test_hold_changes_nothing_but_its_own_count(
    before: list[tuple[Facts, int, int]], held: list[tuple[Facts, int, int]], after: list[tuple[Facts, int, int]]
) -> None:
    params = PARAMS
    flown = run(arbiter.start(0.0), [*timed(before), (10**6, OPEN)], params)[-1]
    pause = [(t, replace(f, fresh=False)) for t, f in timed(held, 10**6)]
    through = run(flown, pause, params)[-1]
    assert through == replace(flown, t_s=through.t_s, hold=True, hold_count=flown.hold_count + 1)
    first, *rest = timed(after)
    resumed = run(through, [(pause[-1][0] + t, f) for t, f in ((0, first[1]), *rest)], params)
    direct = run(flown, [(10**6 + t, f) for t, f in ((0, first[1]), *rest)], params)
    assert [(s.mode, s.switches, s.aborts) for s in resumed] == [(s.mode, s.switches, s.aborts) for s in direct]


def test_hold_is_counted_once_per_spell() -> None:
    stale = replace(OPEN, fresh=False)
    states = run(arbiter.start(0.0), timed([(OPEN, 2, 40), (stale, 5, 40), (OPEN, 2, 40), (stale, 1, 40)]), PARAMS)
    assert [s.hold_count for s in states] == [0, 0, 1, 1, 1, 1, 1, 1, 1, 2]
    assert [s.hold for s in states] == [False, False, True, True, True, True, True, False, False, True]


def test_a_wish_needs_its_ticks_in_a_row() -> None:
    start = in_mode(NavMode.TRAVEL)
    assert run(start, repeated(CLUTTER, 4), PARAMS)[-1].mode == NavMode.TRAVEL
    assert run(start, repeated(CLUTTER, 5), PARAMS)[-1].mode == NavMode.RL
    broken = timed([(CLUTTER, 4, 40), (OPEN, 1, 40), (CLUTTER, 4, 40)])
    assert run(start, broken, PARAMS)[-1].mode == NavMode.TRAVEL


def test_a_change_of_wish_starts_the_debounce_again() -> None:
    states = run(in_mode(NavMode.TRAVEL), timed([(CLUTTER, 4, 40), (NEAR_GOAL, 4, 40)]), PARAMS)
    assert states[-1].mode == NavMode.TRAVEL
    assert states[-1].wish == NavMode.LANDING


@pytest.mark.parametrize("gap_ms", [0, 40, 500, 5000])
def test_a_burst_of_late_scans_does_not_shorten_the_debounce(gap_ms: int) -> None:
    burst = timed([(CLUTTER, 1, gap_ms), (CLUTTER, 30, 1)])
    states = run(in_mode(NavMode.TRAVEL), burst, PARAMS)
    assert all(s.mode == NavMode.TRAVEL for s in states)
    assert run(states[-1], repeated(CLUTTER, 5, burst[-1][0]), PARAMS)[-1].mode == NavMode.RL


def test_slow_scans_need_the_ticks_and_fast_scans_the_time() -> None:
    slow = run(in_mode(NavMode.TRAVEL), repeated(CLUTTER, 10, step_ms=100), PARAMS)
    assert [s.mode for s in slow].index(NavMode.RL) == 4
    fast = run(in_mode(NavMode.TRAVEL), repeated(CLUTTER, 40, step_ms=10), PARAMS)
    assert [s.mode for s in fast].index(NavMode.RL) == 19


def test_dwell_and_debounce_run_at_the_same_time() -> None:
    states = run(arbiter.start(0.0), repeated(CLUTTER, 30), PARAMS)
    assert [s.mode for s in states].index(NavMode.RL) == 24  # the tick at 1.0 s


def test_an_abort_does_not_wait_for_the_dwell_and_the_way_back_does() -> None:
    aborted = run(in_mode(NavMode.LANDING, 0.0), repeated(UNSAFE_GOAL, 5), PARAMS)[-1]
    assert (aborted.mode, aborted.aborts, aborted.switches) == (NavMode.RL, 1, 1)
    back = run(aborted, repeated(NEAR_GOAL, 30, 200), PARAMS)
    assert [s.mode for s in back].index(NavMode.LANDING) == 24


def test_drifting_out_of_a_landing_waits_for_the_dwell_and_is_no_abort() -> None:
    states = run(in_mode(NavMode.LANDING, 0.0), repeated(OPEN, 30), PARAMS)
    assert [s.mode for s in states].index(NavMode.TRAVEL) == 24
    assert states[-1].aborts == 0


@pytest.mark.parametrize("name", ["goal_distance_m", "d_min_m", "s_fuzzy"])
@pytest.mark.parametrize("facts", [OPEN, NEAR_GOAL])
def test_an_unknown_fact_is_unsafe_in_every_mode(name: str, facts: Facts) -> None:
    changed: dict[str, Any] = {name: math.nan}
    unknown = replace(facts, **changed)
    for mode in NavMode:
        assert arbiter.wish_of(mode, unknown, thresholds(PARAMS)).mode == NavMode.RL
    assert not landing_safe(unknown, thresholds(PARAMS))


@settings(max_examples=100, deadline=None)
@given(blocks=st.lists(BLOCKS, min_size=1, max_size=20), jumps_ms=st.lists(st.integers(-5000, 5000), min_size=1))
def test_between_switches_the_clock_has_run_forwards_for_the_dwell_even_when_it_jumps_back(
    blocks: list[tuple[Facts, int, int]], jumps_ms: list[int]
) -> None:
    params, forward_ms = PARAMS, 0
    ticks = [(t + jumps_ms[(i // 7) % len(jumps_ms)], f) for i, (t, f) in enumerate(timed(blocks, 10**5))]
    state = arbiter.start(ticks[0][0] / 1000)
    last_ms = ticks[0][0]
    for t_ms, facts in ticks:
        if facts.fresh and not state.hold:
            forward_ms = forward_ms + t_ms - last_ms if t_ms >= last_ms else 0
        last_ms = t_ms
        after = run(state, [(t_ms, facts)], params)[0]
        if after.mode != state.mode:
            assert forward_ms >= (200 if after.aborts > state.aborts else 1000)
            forward_ms = 0
        state = after


def test_a_restarted_clock_neither_switches_at_once_nor_blocks_for_ever() -> None:
    state = run(ArbiterState(500.0, NavMode.TRAVEL, 100.0), [(500_000 + 40 * i, CLUTTER) for i in range(1, 5)], PARAMS)[
        -1
    ]
    assert state.wish_ticks == 4
    back = run(state, repeated(CLUTTER, 40), PARAMS)
    assert back[0].mode == NavMode.TRAVEL
    assert [s.mode for s in back].index(NavMode.RL) == 25


def test_a_time_that_is_no_number_holds() -> None:
    held = arbiter.decide(in_mode(NavMode.TRAVEL), replace(OPEN, t_s=math.nan), thresholds(PARAMS), PARAMS)
    assert (held.hold, held.t_s) == (True, 0.0)


@pytest.mark.parametrize(
    "pair",
    [
        {"d_enter_m": 3.0, "d_exit_m": 3.0},
        {"s_enter": 0.9},
        {"s_abort": 0.3},
        {"d_abort_m": 1.2},
        {"land_in_m": 5.0},
    ],
)
def test_thresholds_without_hysteresis_are_refused(pair: dict[str, Any]) -> None:
    with pytest.raises(ParamError, match=next(iter(pair))):
        replace(PARAMS, **pair)


@given(s_scale=st.floats(0.1, 1.0), d_scale=st.floats(0.1, 3.0))
def test_the_sensitivity_schedule_keeps_the_hysteresis(s_scale: float, d_scale: float) -> None:
    limits: Thresholds = thresholds(PARAMS, s_scale, d_scale)
    assert limits.d_enter_m < limits.d_exit_m
    assert limits.s_enter < limits.s_exit
    assert limits.s_abort < limits.s_land
    assert limits.d_abort_m < limits.d_land_m
    scores = (limits.s_enter, limits.s_exit, limits.s_land, limits.s_abort)
    assert scores == pytest.approx((0.85 * s_scale, 0.88 * s_scale, 0.30 * s_scale, 0.20 * s_scale))
    assert (limits.d_enter_m, limits.d_exit_m) == pytest.approx((3.0 * d_scale, 3.5 * d_scale))
    assert (limits.d_land_m, limits.d_abort_m, limits.land_in_m, limits.land_out_m) == (1.0, 0.7, 2.0, 3.0)


def test_parameter_names_are_unique_and_fit_the_wire() -> None:
    names = [f.metadata["name"] for f in fields(ArbiterParams)]
    assert len(set(names)) == len(names)
    assert max(map(len, names)) <= core_params.MAVLINK_NAME_MAX
