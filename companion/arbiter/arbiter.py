"""Who flies now: Travel, RL or Landing? One pure transition function over judged facts.

A wish for another mode must last ``debounce_ticks`` ticks and ``debounce_s`` seconds, and the mode ``dwell_s``; both
clocks run at the same time, so switches in any window T are at most 1 + floor(T / max(dwell_s, debounce_s)). Aborting
a landing is the one exit that does not wait for the dwell. Hold is an overlay: it freezes mode and clocks.
"""

import math
from dataclasses import dataclass, replace

from companion.arbiter.facts import ArbiterParams, Facts, Thresholds, clear, landable, landing_safe, risky
from companion.core.types import NavMode

TIME_RESOLUTION_S = 1e-6  # vehicle time comes in whole milliseconds: far above rounding, far below a tick


@dataclass(frozen=True, slots=True)
class ArbiterState:
    """Everything the arbiter remembers."""

    t_s: float  # of the last tick
    mode: NavMode
    mode_s: float = 0.0  # time in the mode, Hold not counted
    wish: NavMode | None = None  # the mode asked for, when it is another one
    wish_ticks: int = 0
    wish_s: float = 0.0
    switches: int = 0  # aborts included
    aborts: int = 0
    hold: bool = False
    hold_count: int = 0


@dataclass(frozen=True, slots=True)
class Wish:
    """The mode that the facts ask for; ``abort``: a landing turned unsafe."""

    mode: NavMode
    abort: bool = False


def start(t_s: float) -> ArbiterState:
    """A flight begins in Travel."""
    return ArbiterState(t_s=t_s, mode=NavMode.TRAVEL)


def decide(state: ArbiterState, facts: Facts, limits: Thresholds, params: ArbiterParams) -> ArbiterState:
    """The state after one tick."""
    if not facts.fresh or not math.isfinite(facts.t_s):
        return _held(state, facts.t_s)
    elapsed_s = 0.0 if state.hold else facts.t_s - state.t_s
    state = _advanced(state, facts.t_s, elapsed_s)
    wish = wish_of(state.mode, facts, limits)
    state = _wished(state, wish.mode, max(elapsed_s, 0.0), params)
    if state.wish is None or not _debounced(state, params):
        return state
    if wish.abort or _lasted(state.mode_s, params.dwell_s):
        return _switched(state, wish)
    return state


def wish_of(mode: NavMode, facts: Facts, limits: Thresholds) -> Wish:
    """Which mode do the facts ask for, timers aside? Most severe first."""
    if mode == NavMode.LANDING:
        if not landing_safe(facts, limits):
            return Wish(NavMode.RL, abort=True)
        if facts.goal_distance_m <= limits.land_out_m:
            return Wish(NavMode.LANDING)
        return Wish(NavMode.TRAVEL if clear(facts, limits) else NavMode.RL)
    if landable(facts, limits):
        return Wish(NavMode.LANDING)
    if mode == NavMode.RL:
        return Wish(NavMode.TRAVEL if clear(facts, limits) else NavMode.RL)
    return Wish(NavMode.RL if risky(facts, limits) else NavMode.TRAVEL)


def switch_bound(duration_s: float, params: ArbiterParams, aborts: int = 0) -> int:
    """Most switches in any window of ``duration_s``: 1 + floor(T / max(T_dwell, N dt)), plus the aborts among them.

    Every abort needs a landing that obeyed the dwell, so the sum is at most twice the bound without aborts.
    """
    spacing_s = max(params.dwell_s, params.debounce_s, TIME_RESOLUTION_S)
    bound = 1 + math.floor((duration_s + TIME_RESOLUTION_S) / spacing_s)
    return bound + min(aborts, bound)


def _held(state: ArbiterState, t_s: float) -> ArbiterState:
    """Mode, wish and clocks as they are; only the overlay is counted."""
    return replace(
        state,
        t_s=t_s if math.isfinite(t_s) else state.t_s,
        hold=True,
        hold_count=state.hold_count + (not state.hold),
    )


def _advanced(state: ArbiterState, t_s: float, elapsed_s: float) -> ArbiterState:
    """The clock moved on. Where it went back nothing counted so far can be trusted: dwell and debounce start again."""
    if elapsed_s < 0.0:
        return replace(state, t_s=t_s, hold=False, mode_s=0.0, wish=None, wish_ticks=0, wish_s=0.0)
    return replace(state, t_s=t_s, hold=False, mode_s=state.mode_s + elapsed_s)


def _wished(state: ArbiterState, mode: NavMode, elapsed_s: float, params: ArbiterParams) -> ArbiterState:
    """Count the wish. One tick stands for one scan period at most: neither a gap nor a burst shortens the debounce."""
    if mode == state.mode:
        return state if state.wish is None else replace(state, wish=None, wish_ticks=0, wish_s=0.0)
    credit_s = min(elapsed_s, params.debounce_s / params.debounce_ticks)
    if mode != state.wish:
        return replace(state, wish=mode, wish_ticks=1, wish_s=credit_s)
    return replace(state, wish_ticks=state.wish_ticks + 1, wish_s=state.wish_s + credit_s)


def _debounced(state: ArbiterState, params: ArbiterParams) -> bool:
    return state.wish_ticks >= params.debounce_ticks and _lasted(state.wish_s, params.debounce_s)


def _lasted(elapsed_s: float, needed_s: float) -> bool:
    return elapsed_s >= needed_s - TIME_RESOLUTION_S


def _switched(state: ArbiterState, wish: Wish) -> ArbiterState:
    return ArbiterState(
        t_s=state.t_s,
        mode=wish.mode,
        switches=state.switches + 1,
        aborts=state.aborts + wish.abort,
        hold_count=state.hold_count,
    )
