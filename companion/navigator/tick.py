"""What is the setpoint for this scan? One tick of the navigator: a pure function of memory, inputs, task, parameters.

Training calls it in-process, a flight calls it over MAVLink, real firmware calls the same.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.arbiter import arbiter
from companion.arbiter.facts import Facts, Thresholds, landing_safe, thresholds
from companion.core import gridmap
from companion.core.frames import yaw_rad
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import AutopilotStatus, LandedState, NavMode, Setpoint, VehicleState
from companion.guidance import landing, limits, line
from companion.navigator.believe import believable, stand_in
from companion.navigator.decide import Decision, decide, due
from companion.navigator.memory import Engagement, Memory
from companion.navigator.params import Params
from companion.navigator.record import Record
from companion.navigator.track import Route, Tracked, course_along, track, turned
from companion.perception.perceive import Percept, Remembered, perceive


@dataclass(frozen=True, slots=True)
class _Scene:
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
class _Steered:
    """What a mode makes of the tick."""

    memory: Memory
    engaged: Engagement
    setpoint: Setpoint
    tracked: Tracked | None = None
    decision: Decision | None = None
    touchdown: bool = False


def tick(memory: Memory, inputs: Inputs, task: Task, params: Params) -> tuple[Memory, Setpoint, Record]:
    """One scan in, one setpoint out.

    Args:
        memory: what the last tick returned, ``memory.start`` at first.
        inputs: state, scan and autopilot status at the scan's instant.
        task: goal and cruise, local NED.
        params: all tunables.

    Returns:
        The next memory, the setpoint that answers the scan, and the record of the tick.
    """
    known = believable(inputs)
    if not known:
        inputs = stand_in(inputs, memory.state, memory.t_s)
    state = inputs.state
    percept = perceive(
        _remembered(memory, inputs.status, params),
        inputs,
        task.goal_ned_m,
        params.vehicle.radius_m,
        params.perception,
        params.map,
        params.movers,
    )
    dt_s = state.t_s - memory.t_s
    memory = replace(memory, grid=percept.grid, tracks=percept.tracks, ticks=memory.ticks + 1, t_s=state.t_s)
    if known:
        memory = replace(memory, state=state, ground_down_m=_ground(memory, inputs))
    goal_m = _goal_distance(state, task)
    if not (inputs.status.offboard and inputs.status.armed) or memory.state is None:
        memory, setpoint = _standby(memory, state)
        return memory, setpoint, Record(inputs, percept, memory, setpoint, goal_m)
    engaged = memory.engaged or _engage(state, task)
    facts = _facts(inputs, percept, engaged, goal_m)
    scene = _Scene(state, percept, task, params, _thresholds(percept, params), facts, dt_s, memory.ground_down_m)
    engaged = _arbitrated(engaged, scene)
    steered = _steer(memory, engaged, scene)
    yaw_sp = memory.yaw_sp_rad if steered.setpoint.yaw_rad is None else steered.setpoint.yaw_rad
    memory = replace(steered.memory, engaged=steered.engaged, yaw_sp_rad=yaw_sp)
    flown_s = steered.engaged.arbiter.t_s - engaged.engaged_t_s
    bound = arbiter.switch_bound(flown_s, params.arbiter, steered.engaged.arbiter.aborts)
    record = Record(
        inputs,
        percept,
        memory,
        steered.setpoint,
        goal_m,
        bound,
        steered.tracked,
        steered.decision,
        line.errors(steered.engaged.line, state.pos_ned_m[:2], yaw_rad(state.q_ned_frd)),
        steered.touchdown,
    )
    return memory, steered.setpoint, record


def _remembered(memory: Memory, status: AutopilotStatus, params: Params) -> Remembered:
    """Nothing, while the motors are off: an autopilot that is still finding north and its place would spoil the map."""
    if not status.armed:
        return Remembered(memory.t_s, gridmap.empty(params.map), (), memory.ground_down_m)
    return Remembered(memory.t_s, memory.grid, memory.tracks, memory.ground_down_m)


def _ground(memory: Memory, inputs: Inputs) -> float:
    """Where it stands is the ground: an autopilot's height may be a metre off where it booted (GPS, barometer)."""
    standing = not inputs.status.armed and inputs.status.landed == LandedState.ON_GROUND
    return float(inputs.state.pos_ned_m[2]) if standing else memory.ground_down_m


def _standby(memory: Memory, state: VehicleState) -> tuple[Memory, Setpoint]:
    """Not ours to fly: answer with where the vehicle is, so that OFFBOARD can be given at any moment."""
    if memory.state is None:
        return memory, Setpoint(state.t_s, None, np.zeros(3), None, None)  # wherever it is: stay
    yaw = yaw_rad(state.q_ned_frd)
    memory = replace(memory, engaged=None, policy=None, yaw_sp_rad=yaw)
    return memory, Setpoint(state.t_s, state.pos_ned_m.copy(), None, None, yaw)


def _engage(state: VehicleState, task: Task) -> Engagement:
    """First tick in OFFBOARD: freeze line, altitude and yaw."""
    here = state.pos_ned_m[:2].copy()
    down_m = float(state.pos_ned_m[2]) if task.down_m is None else task.down_m
    return Engagement(
        here, down_m, state.t_s, arbiter.start(state.t_s), line.line_through(here, task.goal_ned_m), 0.0,
        None, -math.inf, None, None,
    )  # fmt: skip


def _facts(inputs: Inputs, percept: Percept, engaged: Engagement, goal_m: float) -> Facts:
    return Facts(
        t_s=inputs.state.t_s,
        goal_distance_m=goal_m,
        d_min_m=percept.d_min_m,
        s_fuzzy=percept.s_fuzzy,
        line_of_sight=percept.line_of_sight,
        line_done=line.done(engaged.line, inputs.state.pos_ned_m[:2]),
        fresh=inputs.fresh,
    )


def _thresholds(percept: Percept, params: Params) -> Thresholds:
    return thresholds(params.arbiter, d_scale=percept.scale)


def _arbitrated(engaged: Engagement, scene: _Scene) -> Engagement:
    """Let the arbiter decide, and set up what the new mode starts from."""
    before = engaged.arbiter
    after = arbiter.decide(before, scene.facts, scene.limits, scene.params.arbiter)
    engaged = replace(engaged, arbiter=after)
    if after.switches == before.switches:
        return engaged
    if after.mode == NavMode.TRAVEL:
        fresh_line = line.line_through(scene.state.pos_ned_m[:2], scene.task.goal_ned_m)
        return replace(engaged, line=fresh_line, line_s_m=0.0, path=None, landing=None)
    if after.mode == NavMode.RL:
        return replace(engaged, path=None, landing=None)
    began = landing.start(scene.state, scene.task.goal_ned_m, scene.ground_down_m, engaged.down_m)
    return replace(engaged, path=None, landing=began)


def _steer(memory: Memory, engaged: Engagement, scene: _Scene) -> _Steered:
    """The setpoint of the mode; braking and holding come first."""
    if engaged.arbiter.hold:
        return _held(memory, engaged, scene)
    if engaged.arbiter.mode == NavMode.LANDING:
        return _land(memory, engaged, scene)
    if engaged.arbiter.mode == NavMode.TRAVEL:
        return _travel(memory, engaged, scene)
    return _replan(memory, engaged, scene)


def _held(memory: Memory, engaged: Engagement, scene: _Scene) -> _Steered:
    stop, setpoint = limits.hold(scene.state, engaged.stop, memory.yaw_sp_rad, scene.params.limits)
    return _Steered(memory, replace(engaged, stop=stop), setpoint)


def _travel(memory: Memory, engaged: Engagement, scene: _Scene) -> _Steered:
    """Along the frozen line, course corrected by the line law."""
    if _must_stop(scene):
        return _held(memory, engaged, scene)
    state, params = scene.state, scene.params
    vertices = np.stack([engaged.line.origin_ned_m, engaged.line.goal_ned_m])
    speed = math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
    course = line.course_rad(engaged.line, state.pos_ned_m[:2], speed, params.line)
    route = Route(vertices, engaged.line_s_m, scene.task.cruise_m_s, engaged.down_m, params.vehicle.corridor_m, course)
    yaw = turned(memory.yaw_sp_rad, engaged.line.course_rad, scene.dt_s, params.vehicle.yaw_rate_rad_s)
    tracked = track(route, state, scene.percept, yaw, params)
    engaged = replace(engaged, line_s_m=tracked.s_m, stop=None)
    return _Steered(memory, engaged, tracked.setpoint, tracked)


def _replan(memory: Memory, engaged: Engagement, scene: _Scene) -> _Steered:
    """Along the accepted polyline; a new decision where one is due; no path: brake and hold, then ask again."""
    decision = None
    if due(engaged, scene.state, scene.percept, scene.task, scene.params):
        memory, engaged, decision = decide(memory, engaged, scene.state, scene.percept, scene.task, scene.params)
    path, params = engaged.path, scene.params
    if path is None or _must_stop(scene):
        held = _held(memory, replace(engaged, path=None), scene)
        return replace(held, decision=decision)
    margin_m = min(params.vehicle.corridor_m, path.margin_m)
    route = Route(path.vertices_ne_m, path.s_m, scene.task.cruise_m_s, engaged.down_m, margin_m)
    course = course_along(path.vertices_ne_m, path.s_m)
    yaw = turned(memory.yaw_sp_rad, course, scene.dt_s, params.vehicle.yaw_rate_rad_s)
    tracked = track(route, scene.state, scene.percept, yaw, params)
    engaged = replace(engaged, path=replace(path, s_m=tracked.s_m), stop=None)
    return _Steered(memory, engaged, tracked.setpoint, tracked, decision)


def _land(memory: Memory, engaged: Engagement, scene: _Scene) -> _Steered:
    """Onto the goal; the descent pauses at once where it is not safe."""
    assert engaged.landing is not None  # set on entry, cleared on exit
    safe = landing_safe(scene.facts, scene.limits)
    began, command = landing.step(engaged.landing, scene.state, safe, scene.params.landing)
    if _must_stop(scene):
        return _held(memory, replace(engaged, landing=began), scene)
    yaw = turned(memory.yaw_sp_rad, command.yaw_rad, scene.dt_s, scene.params.vehicle.yaw_rate_rad_s)
    setpoint = Setpoint(scene.state.t_s, command.pos_ned_m, command.vel_ned_m_s, command.acc_ned_m_s2, yaw)
    engaged = replace(engaged, landing=began, stop=None)
    return _Steered(memory, engaged, setpoint, touchdown=command.touchdown)


def _must_stop(scene: _Scene) -> bool:
    """Would going on as now touch something remembered before the vehicle stands?"""
    return limits.velocity_stop_needed(
        scene.state.pos_ned_m,
        scene.state.vel_ned_m_s,
        scene.percept.static_ne_m,
        scene.params.vehicle.radius_m,
        scene.params.limits,
    )


def _goal_distance(state: VehicleState, task: Task) -> float:
    return math.hypot(state.pos_ned_m[0] - task.goal_ned_m[0], state.pos_ned_m[1] - task.goal_ned_m[1])
