"""What does the mode in force make of the tick? Travel, RL, Landing, and the hold over all of them; pure; local NED."""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.arbiter.facts import Facts, Thresholds, landing_safe
from companion.core import geometry
from companion.core.task import Task
from companion.core.types import NavMode, Setpoint, VehicleState
from companion.guidance import landing, limits, line, swerve, yielding
from companion.navigator.decide import Answer, Decision, Judge, settle
from companion.navigator.memory import Engagement, Memory
from companion.navigator.params import Params
from companion.navigator.track import Route, Tracked, course_along, track, turned
from companion.perception.perceive import Percept
from companion.perception.threats import threats
from companion.policy.interface import Query


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything one tick knows and does not change."""

    state: VehicleState
    percept: Percept
    task: Task
    params: Params
    limits: Thresholds
    facts: Facts
    dt_s: float
    ground_down_m: float


@dataclass(frozen=True, slots=True)
class Steered:
    """What a mode makes of the tick."""

    memory: Memory
    engaged: Engagement
    setpoint: Setpoint
    tracked: Tracked | None = None
    decision: Decision | None = None
    touchdown: bool = False


@dataclass(frozen=True, slots=True)
class Asked:
    """What the policy said, and who judges it."""

    query: Query
    answer: Answer
    judge: Judge


def steer(memory: Memory, engaged: Engagement, scene: Scene, asked: Asked | None) -> Steered:
    """The setpoint of the mode; braking and holding come first. ``asked``: where a decision was due."""
    steered = _by_mode(memory, engaged, scene, asked)
    gives_way = scene.params.yielding.ahead_s > 0.0 and not engaged.arbiter.hold
    return _giving_way(steered, scene) if gives_way else steered


def _by_mode(memory: Memory, engaged: Engagement, scene: Scene, asked: Asked | None) -> Steered:
    if engaged.arbiter.hold:
        return _held(memory, engaged, scene)
    if engaged.arbiter.mode == NavMode.LANDING:
        return _land(memory, engaged, scene)
    if engaged.arbiter.mode == NavMode.TRAVEL:
        return _travel(memory, engaged, scene)
    return _follow(memory, engaged, scene, asked)


def _held(memory: Memory, engaged: Engagement, scene: Scene) -> Steered:
    stop, setpoint = limits.hold(scene.state, engaged.stop, memory.yaw_sp_rad, scene.params.limits)
    return Steered(memory, replace(engaged, stop=stop), setpoint)


def _travel(memory: Memory, engaged: Engagement, scene: Scene) -> Steered:
    """Along the frozen line, course corrected by the line law."""
    if _must_stop(scene):
        return _swerved(memory, engaged, scene, engaged.line.course_rad) or _held(memory, engaged, scene)
    if engaged.swerve is not None and swerve.past(engaged.swerve, scene.state):
        return _swerving(memory, engaged, scene, engaged.swerve, False)
    state, params = scene.state, scene.params
    vertices = np.stack([engaged.line.origin_ned_m, engaged.line.goal_ned_m])
    speed = math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
    course = line.course_rad(engaged.line, state.pos_ned_m[:2], speed, params.line)
    route = Route(vertices, engaged.line_s_m, scene.task.cruise_m_s, engaged.down_m, params.vehicle.corridor_m, course)
    yaw = turned(memory.yaw_sp_rad, engaged.line.course_rad, scene.dt_s, params.vehicle.yaw_rate_rad_s)
    tracked = track(route, state, scene.percept, yaw, params)
    engaged = replace(engaged, line_s_m=tracked.s_m, stop=None)
    return Steered(memory, engaged, tracked.setpoint, tracked)


def _follow(memory: Memory, engaged: Engagement, scene: Scene, asked: Asked | None) -> Steered:
    """Along the accepted polyline; no path: brake and hold, then ask again."""
    decision = None
    if asked is not None:
        memory, engaged, decision = settle(
            memory, engaged, asked.query, asked.answer, scene.percept, scene.params, asked.judge
        )
    path, params = engaged.path, scene.params
    if path is None or _must_stop(scene):
        planned_rad = None if path is None else course_along(path.vertices_ne_m, path.s_m)
        swerved = _swerved(memory, engaged, scene, planned_rad) if _must_stop(scene) else None
        return replace(swerved or _held(memory, replace(engaged, path=None), scene), decision=decision)
    margin_m = min(params.vehicle.corridor_m, path.margin_m)
    vertices = geometry.extended(path.vertices_ne_m, path.run_out_m)
    route = Route(vertices, path.s_m, scene.task.cruise_m_s, engaged.down_m, margin_m)
    course = course_along(path.vertices_ne_m, path.s_m)
    yaw = turned(memory.yaw_sp_rad, course, scene.dt_s, params.vehicle.yaw_rate_rad_s)
    tracked = track(route, scene.state, scene.percept, yaw, params)
    engaged = replace(engaged, path=replace(path, s_m=tracked.s_m), stop=None)
    return Steered(memory, engaged, tracked.setpoint, tracked, decision)


def _land(memory: Memory, engaged: Engagement, scene: Scene) -> Steered:
    """Onto the goal; the descent pauses at once where it is not safe."""
    assert engaged.landing is not None  # set on entry, cleared on exit
    safe = landing_safe(scene.facts, scene.limits)
    began, command = landing.step(engaged.landing, scene.state, safe, scene.params.landing)
    if _must_stop(scene):
        return _held(memory, replace(engaged, landing=began), scene)
    yaw = turned(memory.yaw_sp_rad, command.yaw_rad, scene.dt_s, scene.params.vehicle.yaw_rate_rad_s)
    setpoint = Setpoint(scene.state.t_s, command.pos_ned_m, command.vel_ned_m_s, command.acc_ned_m_s2, yaw)
    engaged = replace(engaged, landing=began, stop=None)
    return Steered(memory, engaged, setpoint, touchdown=command.touchdown)


def _swerved(memory: Memory, engaged: Engagement, scene: Scene, planned_rad: float | None) -> Steered | None:
    """Past what a stop comes too late for, where the parameters allow it and a side is free; None: stop.

    A stop that has begun goes on: half of it and half a swerve end in what either would have missed.
    """
    if engaged.stop is not None:
        return None
    state, params = scene.state, scene.params
    points, radius_m = scene.percept.points_ne_m, params.vehicle.radius_m
    begun = swerve.turn_aside(engaged.swerve, state, points, radius_m, planned_rad, params.limits)
    return None if begun is None else _swerving(memory, replace(engaged, swerve=begun), scene, begun, True)


def _swerving(memory: Memory, engaged: Engagement, scene: Scene, begun: swerve.Swerve, turning: bool) -> Steered:
    asked = swerve.setpoint(begun, scene.state, turning, engaged.down_m, memory.yaw_sp_rad, scene.params.limits)
    return Steered(memory, replace(engaged, stop=None), asked)


def _giving_way(steered: Steered, scene: Scene) -> Steered:
    """The same, with another velocity where what moves asks for it."""
    state, percept, params = scene.state, scene.percept, scene.params
    near = threats(percept.tracks, percept.static_ne_m, state.t_s, params.movers)
    if len(near.pos_ne_m) == 0:
        return steered
    asked = steered.setpoint.vel_ned_m_s
    wanted = np.zeros(2) if asked is None or steered.engaged.stop is not None else asked[:2]
    moving = yielding.Moving(near.pos_ne_m, near.vel_ne_m_s, near.doubt_m_s, params.movers.radius_m)
    hull = yielding.Hull(params.vehicle.radius_m, scene.task.cruise_m_s, scene.dt_s)
    other = yielding.give_way(state, wanted, moving, near.static_ne_m, hull, params.yielding)
    if other is None:
        return steered
    setpoint = yielding.setpoint(state, other, steered.engaged.down_m, steered.memory.yaw_sp_rad, params.yielding)
    return replace(steered, engaged=replace(steered.engaged, stop=None), setpoint=setpoint, touchdown=False)


def _must_stop(scene: Scene) -> bool:
    """Would going on as now touch something remembered before the vehicle stands?"""
    return limits.velocity_stop_needed(
        scene.state.pos_ned_m,
        scene.state.vel_ned_m_s,
        scene.percept.static_ne_m,
        scene.params.vehicle.radius_m,
        scene.params.limits,
    )
