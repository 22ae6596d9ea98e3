"""Is it open here, or tight? Which of two parameter sets flies, and the map that goes with it; pure; local NED.

Open air wants cells of 20 cm and decimetres of margin, a gap of 75 cm wants cells of 5 cm and centimetres. No set does
both, so the navigator has two: its own, and the profile that ``tight.profile`` names. A Schmitt trigger with a dwell
decides: tight where much is blocked near by, or where nothing that was proposed could be flown; open again where little
is. In a dead end the two would lead to and fro, as the tight set's map soon forgets: where the goal comes no nearer for
a while the open set goes on alone, and later both again. A learned policy without a guard keeps the set that it was
trained with.

Centimetres are for calm air. What the wind does to the vehicle is the acceleration that its tilt and its own drag do
not account for; where that is more than ``calm_m_s2``, the margins stay those of the open.
"""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Final

from companion.checker.checker import Verdict, VerdictKind
from companion.core.frames import down_frd_ned
from companion.core.gridmap import empty, occupied_points, with_hits
from companion.core.params import update
from companion.core.types import VehicleState
from companion.navigator.memory import Memory, Tightness
from companion.navigator.params import Params, TightParams
from companion.navigator.profiles import profile_named
from companion.perception.perceive import Percept
from companion.perception.score import local_density
from companion.policy.expert import GeometricExpert

GRAVITY_M_S2 = 9.81
PUSH_TAU_S = 1.0  # the push of the wind is averaged over
NEARER_M = 0.5  # what counts as nearer to the goal
STILL = 0.7  # of ``calm_m_s2``: below this it is calm again
UPRIGHT = 0.5  # least cosine of the tilt that is reckoned with
STUCK = (VerdictKind.ESCAPE, VerdictKind.REFUSED)
MARGINS: Final = {  # what wind leaves as it is in the open
    "vehicle": ("corridor_m",),
    "expert": ("margin_m", "tight_m"),
    "checker": ("margin_full_m", "margin_reduced_m", "margin_least_m"),
}


def in_force(memory: Memory, params: Params) -> Params:
    """The set that flies this tick."""
    return params if memory.tight.aside is None else tight_set(params, memory.tight.calm)


def felt(now: Tightness, before: VehicleState | None, state: VehicleState, rule: TightParams) -> Tightness:
    """The push of the wind, averaged: how the velocity changed, less what thrust and still air do in level flight."""
    if not rule.profile or before is None or not state.t_s > before.t_s:
        return now
    dt_s = state.t_s - before.t_s
    down = down_frd_ned(state.q_ned_frd)
    share = min(dt_s / PUSH_TAU_S, 1.0)
    was, vel = before.vel_ned_m_s.tolist(), state.vel_ned_m_s.tolist()
    unaided = [(vel[axis] - was[axis]) / dt_s + rule.drag_1_s * vel[axis] for axis in (0, 1)]
    north, east = (
        old + share * (acc + GRAVITY_M_S2 * axis / max(down[2], UPRIGHT) - old)
        for old, acc, axis in zip(now.push_ne_m_s2, unaided, down[:2], strict=True)
    )
    calm = math.hypot(north, east) < rule.calm_m_s2 * (1.0 if now.calm else STILL)
    return replace(now, push_ne_m_s2=(north, east), calm=calm)


def noticed(memory: Memory, percept: Percept, verdict: Verdict | None, goal_m: float, params: Params) -> Memory:
    """After a tick: the map for the next one, which says which set flies it.

    Args:
        memory: with the state and the map of this tick.
        percept: of this tick.
        verdict: where a decision was made.
        goal_m: distance to the goal.
        params: the set in force.
    """
    rule, now, state = params.tight, memory.tight, memory.state
    by_expert = params.policy.guard or params.policy.name == GeometricExpert.name
    if not rule.profile or not by_expert:
        return memory
    if goal_m < now.best_m - NEARER_M:
        now = replace(now, best_m=goal_m, best_t_s=memory.t_s)
        memory = replace(memory, tight=now)
    if memory.t_s - now.since_t_s < rule.dwell_s:
        return memory
    if state is None or state.t_s < memory.t_s:  # a tick without a state that could be believed
        return memory
    density = local_density(percept.bearing_range_m, rule.radius_m)
    stuck = verdict is not None and verdict.kind in STUCK
    in_vain = (memory.t_s - now.best_t_s) % (rule.vain_s + rule.again_s) >= rule.vain_s
    if now.aside is None and not in_vain and (density >= rule.density_enter or stuck):
        onto, aside = empty(tight_set(params).map), memory.grid
    elif now.aside is not None and (in_vain or (density <= rule.density_exit and not stuck)):
        onto, aside = now.aside, None
    else:
        return memory
    hits_ne_m = occupied_points(memory.grid, memory.t_s, params.map)
    grid = with_hits(onto, hits_ne_m, state.pos_ned_m[:2], memory.t_s)
    return replace(memory, grid=grid, tight=replace(now, since_t_s=memory.t_s, aside=aside))


def sets(params: Params) -> tuple[Params, ...]:
    """Every set that may come to fly: read before a flight, they are not read in it. Raises ParamError."""
    return params, tight_set(params), tight_set(params, calm=False)


@lru_cache(maxsize=8)
def tight_set(params: Params, calm: bool = True) -> Params:
    """The parameters with the profile's on top, but for those that differ from the defaults: what was chosen, holds.

    Themselves where no profile is named. Raises ParamError.
    """
    if not params.tight.profile:
        return params
    chosen = {
        group: {name: value for name, value in fields.items() if _open_to(params, group, name, calm)}
        for group, fields in profile_named(params.tight.profile).items()
        if group != "tight"  # when to change back is said by the set of the open
    }
    return update(params, chosen)


def _open_to(params: Params, group: str, name: str, calm: bool) -> bool:
    """May the profile set this one? An unknown one too: ``update`` will say so."""
    as_given, as_shipped = (getattr(getattr(whole, group, None), name, None) for whole in (params, Params()))
    return as_given == as_shipped and (calm or name not in MARGINS.get(group, ()))
