"""What does one tick of flight earn? A state machine over the rows of a reward table; pure; local NED, metres, seconds.

``step(state, facts, table) -> (state, rows)``: ``rows`` holds what is not zero, in the table's own units. Every row is
an event of the paper's tables; what "every step" means is the table's clock.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from companion.core.types import NavMode
from mission.training.reward_tables import (
    DEPARTURE_M,
    ENDPOINT_M,
    NO_PROGRESS_M,
    NO_PROGRESS_STEPS,
    PAPER_STEP_S,
    RECENT_ENDPOINTS,
    RewardTable,
)

GOAL_M = 2.0  # both tables
NO_PROGRESS_S = NO_PROGRESS_STEPS * PAPER_STEP_S
TIME_RESOLUTION_S = 1e-6
Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TickFacts:
    """What happened up to one tick."""

    t_s: float
    pos_ne_m: Place
    goal_distance_m: float
    d_min_m: float  # inf when nothing is near
    mode: str  # NavMode, 'hold', or whatever a baseline calls its only mode
    endpoint_ne_m: Place | None = None  # where an RL path ends that was accepted in this tick
    way_s: float = 0.0  # that the rest of the way would take, by the true map
    cross_track_m: float | None = None  # off the guidance line of the present or last Travel
    contact: bool = False
    failure: bool = False  # out of bounds or attitude


@dataclass(frozen=True, slots=True)
class RewardState:
    """What the rows remember of an episode."""

    t_s: float
    goal_distance_m: float
    mode: str
    way_s: float = 0.0
    contact: bool = False
    failure: bool = False
    goal: bool = False  # has been reached
    anchor_t_s: float = 0.0  # since when, and
    anchor_ne_m: Place = (0.0, 0.0)  # round which place, displacement is watched
    stuck: bool = False  # no progress, at this very tick
    departed: bool = False
    near: bool = False  # in an obstacle zone
    exit_m: float = math.inf  # goal distance of the best RL -> Travel paid so far, at first of the start
    zone_exit_m: float = math.inf  # the same of zone exits
    bypasses: int = 0
    travels: int = 0
    zone_exits: int = 0
    novelties: int = 0
    endpoints: tuple[Place, ...] = ()


Row = tuple[RewardState, float]


def start(facts: TickFacts) -> RewardState:
    """Before the first tick that earns anything."""
    return RewardState(
        t_s=facts.t_s,
        goal_distance_m=facts.goal_distance_m,
        mode=facts.mode,
        way_s=facts.way_s,
        anchor_t_s=facts.t_s,
        anchor_ne_m=facts.pos_ne_m,
        exit_m=facts.goal_distance_m,
        zone_exit_m=facts.goal_distance_m,
    )


def step(state: RewardState, facts: TickFacts, table: RewardTable) -> tuple[RewardState, dict[str, float]]:
    """The state after one tick, and what each row contributed."""
    rows: dict[str, float] = {}
    for name, row in ROWS.items():
        state, value = row(state, facts, table)
        if value:
            rows[name] = value
    state = replace(
        state,
        t_s=facts.t_s,
        goal_distance_m=facts.goal_distance_m,
        mode=_mode(state, facts),
        way_s=facts.way_s,
        contact=facts.contact,
        failure=facts.failure,
    )
    return state, rows


def ends(state: RewardState, table: RewardTable) -> bool:
    """Does the table itself end the episode at this tick?"""
    return state.stuck and table.no_progress_ends


def _step(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    return state, table.step * _steps(state, facts, table)


def _progress(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    return state, table.progress * (state.goal_distance_m - facts.goal_distance_m)


def _way(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    return state, table.way * (state.way_s - facts.way_s)


def _goal(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    if state.goal or not facts.goal_distance_m < GOAL_M:
        return state, 0.0
    return replace(state, goal=True), table.goal


def _crash(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    return state, table.crash if facts.contact and not state.contact else 0.0


def _failure(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    return state, table.failure if facts.failure and not state.failure else 0.0


def _no_progress(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    """Displacement from where the vehicle was 5 s ago at most; having moved, or paid, the watch begins anew."""
    if math.dist(facts.pos_ne_m, state.anchor_ne_m) >= NO_PROGRESS_M or facts.mode == NavMode.LANDING:
        return replace(state, anchor_t_s=facts.t_s, anchor_ne_m=facts.pos_ne_m, stuck=False), 0.0
    if facts.t_s - state.anchor_t_s < NO_PROGRESS_S - TIME_RESOLUTION_S:
        return replace(state, stuck=False) if state.stuck else state, 0.0
    return replace(state, anchor_t_s=facts.t_s, anchor_ne_m=facts.pos_ne_m, stuck=True), table.no_progress


def _proximity(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    inside_m = max(table.zone_m - facts.d_min_m, 0.0)
    return state, table.proximity * inside_m * _steps(state, facts, table)


def _departure(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    """Once, where the line is left; never in Landing, which follows none."""
    if facts.cross_track_m is None or facts.mode == NavMode.LANDING:
        return state, 0.0
    off_m = abs(facts.cross_track_m)
    if off_m > DEPARTURE_M and not state.departed:
        return replace(state, departed=True), table.departure
    back = state.departed and off_m <= DEPARTURE_M / 2
    return replace(state, departed=False) if back else state, 0.0


def _left_rl(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    """Bypass and one-shot switch: RL -> Travel, safe, and for new progress where the table asks for it."""
    left = state.mode == NavMode.RL and facts.mode == NavMode.TRAVEL
    if not left or facts.contact or facts.failure or not _new(facts, state.exit_m, table):
        return state, 0.0
    return replace(state, exit_m=min(state.exit_m, facts.goal_distance_m)), 1.0


def _bypass(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    left, paid = _left_rl(state, facts, table)
    if not paid or table.bypass == 0.0 or state.bypasses >= table.bypass_max:
        return state, 0.0
    return replace(left, bypasses=state.bypasses + 1), table.bypass


def _travel(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    left, paid = _left_rl(state, facts, table)
    if not paid or table.travel == 0.0 or state.travels:
        return state, 0.0
    return replace(left, travels=1), table.travel


def _zone_exit(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    inside = not facts.d_min_m > table.zone_m
    if inside or not state.near:
        return replace(state, near=True) if inside and not state.near else state, 0.0
    out = replace(state, near=False)
    if state.zone_exits >= table.zone_exit_max or not _new(facts, state.zone_exit_m, table):
        return out, 0.0
    nearest_m = min(state.zone_exit_m, facts.goal_distance_m)
    return replace(out, zone_exits=state.zone_exits + 1, zone_exit_m=nearest_m), table.zone_exit


def _endpoint_novel(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    """No earlier endpoint is near."""
    place = facts.endpoint_ne_m
    if place is None or _among(place, state.endpoints) or state.novelties >= table.endpoint_novel_max:
        return state, 0.0
    return replace(state, novelties=state.novelties + 1), table.endpoint_novel


def _endpoint_repeated(state: RewardState, facts: TickFacts, table: RewardTable) -> Row:
    """One of the last ten is near. The place is remembered here, after novelty has been judged."""
    place = facts.endpoint_ne_m
    if place is None:
        return state, 0.0
    recent = _among(place, state.endpoints[-RECENT_ENDPOINTS:])
    return replace(state, endpoints=(*state.endpoints, place)), table.endpoint_repeated if recent else 0.0


def _among(place: Place, places: tuple[Place, ...]) -> bool:
    return any(math.dist(place, other) < ENDPOINT_M for other in places)


def _new(facts: TickFacts, before_m: float, table: RewardTable) -> bool:
    return table.new_progress_m is None or facts.goal_distance_m <= before_m - table.new_progress_m


def _steps(state: RewardState, facts: TickFacts, table: RewardTable) -> float:
    return (facts.t_s - state.t_s) / table.clock_s


def _mode(state: RewardState, facts: TickFacts) -> str:
    """Hold is an overlay: the mode under it goes on."""
    return state.mode if facts.mode == "hold" else facts.mode


ROWS: dict[str, Callable[[RewardState, TickFacts, RewardTable], Row]] = {
    "step": _step,
    "progress": _progress,
    "way": _way,
    "goal": _goal,
    "crash": _crash,
    "failure": _failure,
    "no_progress": _no_progress,
    "proximity": _proximity,
    "departure": _departure,
    "bypass": _bypass,
    "travel": _travel,
    "zone_exit": _zone_exit,
    "endpoint_novel": _endpoint_novel,
    "endpoint_repeated": _endpoint_repeated,
}
