"""What is the setpoint for this scan? One tick of the navigator: a pure function of memory, inputs, task, parameters.

Training calls it in-process, a flight calls it over MAVLink, real firmware calls the same. A tick has two halves:
``sense`` ends where the policy would be asked, ``act`` goes on with the answer; training puts its own in between.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from companion.arbiter import arbiter
from companion.arbiter.facts import Facts, Thresholds, thresholds
from companion.checker.checker import check
from companion.core import gridmap
from companion.core.frames import yaw_rad
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import AutopilotStatus, LandedState, NavMode, Setpoint, VehicleState
from companion.guidance import landing, line
from companion.navigator import tightness
from companion.navigator.believe import believable, stand_in
from companion.navigator.decide import Answer, Judge, ask, due, question
from companion.navigator.memory import Engagement, Memory, Tightness
from companion.navigator.modes import Asked, Scene, steer
from companion.navigator.params import Params
from companion.navigator.record import Record
from companion.perception.perceive import Percept, Remembered, perceive
from companion.policy.interface import Query


@dataclass(frozen=True, slots=True)
class Pending:
    """A tick up to the question for the policy."""

    query: Query | None  # None: no decision is due, ``act`` needs no answer
    memory: Memory
    params: Params  # in force
    inputs: Inputs
    percept: Percept
    goal_m: float
    engaged: Engagement | None  # None: not ours to fly
    scene: Scene | None


def tick(memory: Memory, inputs: Inputs, task: Task, params: Params) -> tuple[Memory, Setpoint, Record]:
    """One scan in, one setpoint out; the policy that the parameters name is asked where a decision is due.

    Args:
        memory: what the last tick returned, ``memory.start`` at first.
        inputs: state, scan and autopilot status at the scan's instant.
        task: goal and cruise, local NED.
        params: all tunables.

    Returns:
        The next memory, the setpoint that answers the scan, and the record of the tick.
    """
    pending = sense(memory, inputs, task, params)
    return act(pending, None if pending.query is None else ask(pending.query, pending.memory.policy, pending.params))


def sense(memory: Memory, inputs: Inputs, task: Task, params: Params) -> Pending:
    """The first half of a tick: perceive, let the arbiter decide who flies, and put the question where one is due."""
    known = believable(inputs)
    if not known:
        inputs = stand_in(inputs, memory.state, memory.t_s)
    state = inputs.state
    if not inputs.status.armed:
        memory = replace(memory, tight=Tightness())
    params = tightness.in_force(memory, params)
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
    memory = replace(
        memory,
        grid=percept.grid,
        tracks=percept.tracks,
        ticks=memory.ticks + 1,
        t_s=state.t_s,
        state=state if known else memory.state,
        tight=tightness.felt(memory.tight, memory.state, state, params.tight) if known else memory.tight,
        ground_down_m=_ground(memory, inputs) if known else memory.ground_down_m,
    )
    goal_m = _goal_distance(state, task)
    if not (inputs.status.offboard and inputs.status.armed) or memory.state is None:
        return Pending(None, memory, params, inputs, percept, goal_m, None, None)
    engaged = memory.engaged or _engage(state, task)
    facts = _facts(inputs, percept, engaged, goal_m)
    scene = Scene(state, percept, task, params, _thresholds(percept, params), facts, dt_s, memory.ground_down_m)
    engaged = _arbitrated(engaged, scene)
    query = None
    if engaged.arbiter.mode == NavMode.RL and not engaged.arbiter.hold and due(engaged, state, percept, task, params):
        query = question(engaged, state, percept, task, params)
    return Pending(query, memory, params, inputs, percept, goal_m, engaged, scene)


def act(pending: Pending, answer: Answer | None, judge: Judge = check) -> tuple[Memory, Setpoint, Record]:
    """The second half: ``answer`` to ``pending.query`` (None exactly where that is None), checked and flown.

    ``judge`` is the checker; only a measurement of what the checker is worth names another one.
    """
    if (answer is None) != (pending.query is None):
        raise ValueError("an answer is needed exactly where a query was put")
    memory, inputs, percept, engaged, scene = (
        pending.memory, pending.inputs, pending.percept, pending.engaged, pending.scene,
    )  # fmt: skip
    if engaged is None or scene is None:
        memory, setpoint = _standby(memory, inputs.state)
        return memory, setpoint, Record(inputs, percept, memory, setpoint, pending.goal_m)
    asked = None if pending.query is None or answer is None else Asked(pending.query, answer, judge)
    steered = steer(memory, engaged, scene, asked)
    yaw_sp = memory.yaw_sp_rad if steered.setpoint.yaw_rad is None else steered.setpoint.yaw_rad
    memory = replace(steered.memory, engaged=steered.engaged, yaw_sp_rad=yaw_sp)
    verdict = None if steered.decision is None else steered.decision.verdict
    memory = tightness.noticed(memory, percept, verdict, pending.goal_m, scene.params)
    flown_s = steered.engaged.arbiter.t_s - engaged.engaged_t_s
    bound = arbiter.switch_bound(flown_s, scene.params.arbiter, steered.engaged.arbiter.aborts)
    record = Record(
        inputs,
        percept,
        memory,
        steered.setpoint,
        pending.goal_m,
        bound,
        steered.tracked,
        steered.decision,
        line.errors(steered.engaged.line, inputs.state.pos_ned_m[:2], yaw_rad(inputs.state.q_ned_frd)),
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
    tight = replace(memory.tight, best_m=math.inf)  # the next flight may begin anywhere
    memory = replace(memory, engaged=None, policy=None, guard=None, yaw_sp_rad=yaw, tight=tight)
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


def _arbitrated(engaged: Engagement, scene: Scene) -> Engagement:
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


def _goal_distance(state: VehicleState, task: Task) -> float:
    return math.hypot(state.pos_ned_m[0] - task.goal_ned_m[0], state.pos_ned_m[1] - task.goal_ned_m[1])
