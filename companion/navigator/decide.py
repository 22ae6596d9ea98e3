"""Which polyline does RL mode fly next? When to ask the policy, what, and what the checker says; pure; local NED."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from companion.checker.checker import CheckQuery, Verdict, VerdictKind, check, recheck
from companion.checker.params import CheckerParams
from companion.core import geometry
from companion.core.params import ParamError, nearest
from companion.core.task import Task
from companion.core.types import F64, VehicleState
from companion.guidance import follower
from companion.navigator import guard
from companion.navigator.memory import Engagement, Memory, Path
from companion.navigator.params import Params
from companion.perception.observation import observation
from companion.perception.perceive import Percept, representatives
from companion.policy import store
from companion.policy.expert import ExpertParams, GeometricExpert
from companion.policy.interface import Policy, Proposal, Query

ESCAPE_M = 2.0  # length of the escape segment into the widest free sector
ESCAPE_WAYS = 16


Judge = Callable[[CheckQuery, CheckerParams], Verdict]  # ``checker.check``; another one only to measure its worth


@dataclass(frozen=True, slots=True)
class Answer:
    """What the policy said."""

    proposal: Proposal | None
    memory: F64 | None  # what it wants to see again
    checked: bool = True  # False: flown as it is, only to measure in simulation what the checker is worth


@dataclass(frozen=True, slots=True)
class Decision:
    """One RL decision, for the record."""

    proposal_ne_m: F64 | None  # (k, 2)
    verdict: Verdict
    guarded: bool  # the expert's path was judged, and flown, instead


def due(engaged: Engagement, state: VehicleState, percept: Percept, task: Task, params: Params) -> bool:
    """Is a new decision needed: none yet, used up, too old, or refused by what was seen since?"""
    if state.t_s - engaged.tried_t_s < params.policy.retry_s - 1e-6:
        return False
    path = engaged.path
    if path is None or state.t_s - path.decided_t_s >= path.lasts_s - 1e-6:
        return True
    end = path.vertices_ne_m[-1]
    left_m = geometry.length(path.vertices_ne_m) - path.s_m
    to_goal = math.hypot(end[0] - task.goal_ned_m[0], end[1] - task.goal_ned_m[1])
    used_up = left_m < path.used_up_m and to_goal > path.used_up_m
    radius_m = params.checker.recheck_radius_m(params.vehicle.radius_m, path.margin_m)
    return used_up or not recheck(path.vertices_ne_m, path.s_m, percept.points_ne_m, radius_m)


def question(engaged: Engagement, state: VehicleState, percept: Percept, task: Task, params: Params) -> Query:
    """What a policy is asked."""
    obstacles_ne_m = representatives(percept.bearing_range_m, state, params.perception.sense_radius_m)
    return Query(
        state,
        task.goal_ned_m,
        percept.grid,
        percept.hazard_ne_m,
        params.vehicle.radius_m,
        _prefix(engaged, state, params),
        observation(state, obstacles_ne_m, engaged.start_ne_m, task.goal_ned_m),
        engaged.start_ne_m,
        task.cruise_m_s,
        engaged.course_rad,
    )


def ask(query: Query, memory: F64 | None, params: Params) -> Answer:
    """The policy that the parameters name, asked once. Raises ParamError with the nearest name."""
    return Answer(*policy_named(params.policy.name, params).propose(query, memory))


def settle(
    memory: Memory, engaged: Engagement, query: Query, answer: Answer, percept: Percept, params: Params, judge: Judge
) -> tuple[Memory, Engagement, Decision]:
    """Let the checker judge the answer; the accepted path, or None (brake and hold), goes into the engagement."""
    state, proposal = query.state, answer.proposal
    asked = CheckQuery(
        start_ned_m=query.prefix_ne_m[0],
        start_vel_ned_m_s=state.vel_ned_m_s[:2],
        goal_ned_m=query.goal_ne_m,
        radius_m=query.radius_m,
        points_ned_m=percept.points_ne_m,
        proposal_ned_m=None if proposal is None else proposal.waypoints_ne_m,
        escape_ned_m=None,
        others_ned_m=() if proposal is None else proposal.others_ne_m,
    )
    verdict, guarded, way = judge(asked, params.checker), False, memory.guard
    if params.policy.guard and params.policy.name != GeometricExpert.name:
        expert, way = _expert(params.expert, params).propose(query, memory.guard)
        theirs = replace(asked, proposal_ned_m=None if expert is None else expert.waypoints_ne_m, others_ned_m=())
        pace = guard.Pace(query.cruise_m_s, params.limits)
        theirs_verdict = check(theirs, params.checker)
        guarded = guard.steps_in(verdict, theirs_verdict, asked, pace, params.policy.guard_ratio)
        verdict = theirs_verdict if guarded else verdict
    if verdict.path_ned_m is None:
        escape = _escape(state.pos_ned_m[:2], query.goal_ne_m, percept, params)
        verdict = check(replace(asked, proposal_ned_m=None, others_ned_m=(), escape_ned_m=escape), params.checker)
    path, course_rad = None, engaged.course_rad
    if verdict.path_ned_m is not None and verdict.margin_m is not None:
        lasts_s, used_up_m, run_out_m = params.policy.wear(guarded)
        if not guarded and proposal is not None and proposal.lasts_s is not None:
            lasts_s = proposal.lasts_s
        vertices = verdict.path_ned_m
        if (
            verdict.kind is VerdictKind.ESCAPE
            or math.dist(vertices[-1].tolist(), query.goal_ne_m[:2].tolist()) < used_up_m
        ):
            run_out_m = 0.0
        ahead = vertices[-1] - query.prefix_ne_m[-1]
        course_rad = math.atan2(ahead[1], ahead[0])
        path = Path(vertices, 0.0, verdict.margin_m, state.t_s, lasts_s, used_up_m, run_out_m)
    memory = replace(memory, policy=answer.memory, guard=way, decisions=memory.decisions + 1)
    engaged = replace(engaged, path=path, tried_t_s=state.t_s, course_rad=course_rad)
    return memory, engaged, Decision(asked.proposal_ned_m, verdict, guarded)


def policy_named(name: str, params: Params) -> Policy:
    """The geometric expert, or a learned policy by the name of a shipped one or by its folder. Raises ParamError."""
    if name == GeometricExpert.name:
        return _expert(params.expert, params)
    return _learned(name, params)


@lru_cache(maxsize=8)
def _expert(expert: ExpertParams, params: Params) -> Policy:
    return GeometricExpert(expert, params.map)


@lru_cache(maxsize=8)
def _learned(name: str, params: Params) -> Policy:
    if not store.is_folder(name) and name not in (known := store.shipped()):
        raise ParamError(f"unknown policy '{name}'{nearest(name, [GeometricExpert.name, *known])}")
    return store.load_policy(name, params.map)


def _prefix(engaged: Engagement, state: VehicleState, params: Params) -> F64:
    """The stretch of the old path that is flown while the new one is not there yet; else just the vehicle's place.

    A path that began at the vehicle each time would forgive every tracking error and cut every corner.
    """
    path = engaged.path
    if path is None or engaged.stop is not None:
        return state.pos_ned_m[None, :2].copy()
    at = follower.progress(path.vertices_ne_m, state.pos_ned_m, path.s_m, params.follower)
    if not at.distance_m < params.policy.rejoin_m:
        return state.pos_ned_m[None, :2].copy()
    speed = math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
    return geometry.part(path.vertices_ne_m, at.s_m, at.s_m + speed * params.policy.lead_s)


def _escape(pos_ne_m: F64, goal_ne_m: F64, percept: Percept, params: Params) -> F64:
    """(1, 2) end of a short segment into the direction that is free the farthest, goalwards among equals."""
    goal_course = math.atan2(goal_ne_m[1] - pos_ne_m[1], goal_ne_m[0] - pos_ne_m[0])
    radius_m = params.vehicle.radius_m + params.expert.tight_m
    near_ne_m = geometry.points_near(pos_ne_m[None], percept.points_ne_m, ESCAPE_M + radius_m)
    best, best_free = pos_ne_m, -1.0
    for way in range(ESCAPE_WAYS):
        turn = math.tau * ((way + 1) // 2) / ESCAPE_WAYS * (1 if way % 2 else -1)
        direction = np.array([math.cos(goal_course + turn), math.sin(goal_course + turn)])
        ray = np.stack([pos_ne_m, pos_ne_m + ESCAPE_M * direction])
        free = geometry.swept_free_length(ray, near_ne_m, radius_m)
        if free > best_free + 0.05:
            best, best_free = pos_ne_m + free * direction, free
    return best[None]
