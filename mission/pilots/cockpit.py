"""What do the classical pilots share? Perception, standby, hold, landing, and how a velocity is flown; pure, local NED.

Everybody perceives with ``companion.perception``, is held to the cruise speed, flies velocities by the same setpoint,
holds where inputs are stale, and lands by the same profile from the same distance. What is left to a recipe is how it
gets to the goal: ``Steer``, one function from a ``View`` and its own memory to a ``Wish``.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from companion import navigator
from companion.arbiter.facts import Facts, landable, landing_safe, thresholds
from companion.core import geometry, gridmap
from companion.core.frames import yaw_rad
from companion.core.gridmap import GridMap
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import F64, LandedState, Setpoint, VehicleState
from companion.guidance import landing, limits
from companion.guidance.landing import LandingState
from companion.guidance.limits import HoldMemory
from companion.navigator.believe import believable, stand_in
from companion.navigator.track import turned
from companion.perception.movers import Track
from companion.perception.perceive import Percept, Remembered, perceive
from mission.pilots.interface import PilotNote

STANDBY, HOLD, LANDING = "standby", "hold", "landing"
COURSE_FROM_M_S = 0.3  # a slower wish does not turn the nose


@dataclass(frozen=True, slots=True)
class Engaged:
    """What was frozen when the autopilot went to OFFBOARD, and what the recipe remembers since."""

    start_ne_m: F64  # (2,)
    down_m: float  # cruise altitude
    landing: LandingState | None = None
    stop: HoldMemory | None = None  # while holding
    own: Any = None  # of the recipe; None at first
    mode: str = STANDBY
    switches: int = 0


@dataclass(frozen=True, slots=True)
class Memory:
    """Everything a classical pilot remembers."""

    grid: GridMap
    tracks: tuple[Track, ...] = ()
    t_s: float = 0.0
    yaw_sp_rad: float = 0.0
    state: VehicleState | None = None  # the last one that could be believed
    ground_down_m: float = 0.0
    engaged: Engaged | None = None


@dataclass(frozen=True, slots=True)
class View:
    """What a recipe sees of one tick."""

    state: VehicleState
    percept: Percept
    task: Task
    params: navigator.Params
    dt_s: float
    start_ne_m: F64  # (2,) where OFFBOARD began
    down_m: float
    yaw_sp_rad: float

    @property
    def pos_ne_m(self) -> F64:
        """(2,) of the vehicle."""
        return self.state.pos_ned_m[:2]

    @property
    def vel_ne_m_s(self) -> F64:
        """(2,) of the vehicle."""
        return self.state.vel_ned_m_s[:2]

    @property
    def goal_m(self) -> float:
        """Horizontal distance to the goal."""
        return math.dist(self.pos_ne_m.tolist(), self.task.goal_ned_m.tolist())

    @property
    def goal_course_rad(self) -> float:
        """Course to the goal."""
        north_m, east_m = (self.task.goal_ned_m - self.pos_ne_m).tolist()
        return math.atan2(east_m, north_m)

    @property
    def approach_m_s(self) -> float:
        """Cruise, or what comes to rest at the goal."""
        return min(self.task.cruise_m_s, limits.end_speed(self.goal_m, self.params.limits))


@dataclass(frozen=True, slots=True)
class Wish:
    """What a recipe asks for: a velocity, or a setpoint of its own, or neither: brake and hold."""

    mode: str
    velocity_ne_m_s: F64 | None = None  # (2,)
    setpoint: Setpoint | None = None  # of a path follower; its yaw is replaced
    course_rad: float | None = None  # where the nose goes; None: along the velocity
    decided: bool = False
    path_ne_m: F64 | None = None


Steer = Callable[[View, Any], tuple[Any, Wish]]


class Recipe(ABC):
    """A pilot but for its way to the goal; see ``Pilot``."""

    name: str
    source: str

    def start(self, params: navigator.Params) -> Memory:
        """Nothing seen, nobody flies."""
        return Memory(gridmap.empty(params.map))

    def tick(
        self, memory: Memory, inputs: Inputs, task: Task, params: navigator.Params
    ) -> tuple[Memory, Setpoint, PilotNote]:
        """See ``Pilot.tick``."""
        return fly(memory, inputs, task, params, self.steer)

    @abstractmethod
    def steer(self, view: View, own: Any) -> tuple[Any, Wish]:
        """What is asked for now, and what is remembered for the next tick; ``own`` is None at first."""


def fly(
    memory: Memory, inputs: Inputs, task: Task, params: navigator.Params, steer: Steer
) -> tuple[Memory, Setpoint, PilotNote]:
    """One tick of the pilot whose recipe is ``steer``."""
    known = believable(inputs)
    if not known:
        inputs = stand_in(inputs, memory.state, memory.t_s)
    state, percept = inputs.state, _perceived(memory, inputs, task, params)
    dt_s = state.t_s - memory.t_s
    memory = replace(memory, grid=percept.grid, tracks=percept.tracks, t_s=state.t_s)
    if known:
        memory = replace(memory, state=state, ground_down_m=_ground(memory, inputs))
    if not (inputs.status.offboard and inputs.status.armed) or memory.state is None:
        return _standby(memory, state)
    engaged = memory.engaged or _engage(state, task)
    view = View(state, percept, task, params, dt_s, engaged.start_ne_m, engaged.down_m, memory.yaw_sp_rad)
    engaged, wish, setpoint = _steered(engaged, view, inputs.fresh, memory.ground_down_m, steer)
    yaw = setpoint.yaw_rad if setpoint.yaw_rad is not None else memory.yaw_sp_rad
    engaged = replace(engaged, mode=wish.mode, switches=engaged.switches + (engaged.mode not in (wish.mode, STANDBY)))
    note = PilotNote(wish.mode, engaged.switches, decided=wish.decided, path_ne_m=wish.path_ne_m)
    return replace(memory, yaw_sp_rad=yaw, engaged=engaged), setpoint, note


def velocity_setpoint(view: View, velocity_ne_m_s: F64, yaw_rad: float) -> Setpoint:
    """Fly a velocity at cruise altitude, never faster than the cap.

    The position goes along (so that it asks for nothing but the height), and an acceleration closes a stiffer velocity
    loop over the link: what the navigator's follower gives for a straight path.
    """
    follower = view.params.follower
    velocity = shortened(velocity_ne_m_s, view.task.cruise_m_s)
    place = view.pos_ne_m + velocity * follower.delay_s
    push = shortened(follower.acc_gain_1_s * (velocity - view.vel_ne_m_s), follower.acc_max_m_s2)
    return Setpoint(
        view.state.t_s,
        np.array([place[0], place[1], view.down_m]),
        np.array([velocity[0], velocity[1], 0.0]),
        np.array([push[0], push[1], 0.0]),
        yaw_rad,
    )


def shortened(vector: F64, most: float) -> F64:
    """The vector (2,), no longer than ``most``; zero if it is not finite."""
    return np.array(geometry.shortened(float(vector[0]), float(vector[1]), most))


def _steered(
    engaged: Engaged, view: View, fresh: bool, ground_down_m: float, steer: Steer
) -> tuple[Engaged, Wish, Setpoint]:
    """Hold where inputs are stale, else land where that may be, else what the recipe wants."""
    if not fresh:
        return _held(engaged, view, Wish(HOLD))
    engaged = _landing_or_not(engaged, view, ground_down_m)
    if engaged.landing is not None:
        return _land(engaged, view)
    own, wish = steer(view, engaged.own)
    engaged = replace(engaged, own=own)
    if wish.setpoint is None and wish.velocity_ne_m_s is None:
        return _held(engaged, view, wish)
    velocity = wish.velocity_ne_m_s
    course = wish.course_rad
    if course is None and velocity is not None and np.hypot(*velocity) > COURSE_FROM_M_S:
        course = math.atan2(float(velocity[1]), float(velocity[0]))
    yaw = turned(view.yaw_sp_rad, course, view.dt_s, view.params.vehicle.yaw_rate_rad_s)
    if wish.setpoint is not None:
        setpoint = replace(wish.setpoint, yaw_rad=yaw)
    else:
        setpoint = velocity_setpoint(view, np.zeros(2) if velocity is None else velocity, yaw)
    return replace(engaged, stop=None), wish, setpoint


def _held(engaged: Engaged, view: View, wish: Wish) -> tuple[Engaged, Wish, Setpoint]:
    stop, setpoint = limits.hold(view.state, engaged.stop, view.yaw_sp_rad, view.params.limits)
    return replace(engaged, stop=stop), wish, setpoint


def _landing_or_not(engaged: Engaged, view: View, ground_down_m: float) -> Engaged:
    """Landing begins and ends under the navigator's conditions, without its clocks."""
    facts, limits_ = _facts(view), thresholds(view.params.arbiter)
    if engaged.landing is None:
        if not landable(facts, limits_):
            return engaged
        began = landing.start(view.state, view.task.goal_ned_m, ground_down_m, engaged.down_m)
        return replace(engaged, landing=began, stop=None)
    if landing_safe(facts, limits_) and facts.goal_distance_m < limits_.land_out_m:
        return engaged
    return replace(engaged, landing=None)


def _land(engaged: Engaged, view: View) -> tuple[Engaged, Wish, Setpoint]:
    assert engaged.landing is not None  # the caller's question
    began, command = landing.step(engaged.landing, view.state, True, view.params.landing)
    engaged = replace(engaged, landing=began)
    if stop_needed(view):
        return _held(engaged, view, Wish(LANDING))
    yaw = turned(view.yaw_sp_rad, command.yaw_rad, view.dt_s, view.params.vehicle.yaw_rate_rad_s)
    setpoint = Setpoint(view.state.t_s, command.pos_ned_m, command.vel_ned_m_s, command.acc_ned_m_s2, yaw)
    return replace(engaged, stop=None), Wish(LANDING), setpoint


def stop_needed(view: View) -> bool:
    """Would going on as now touch something remembered before the vehicle stands?"""
    state, params = view.state, view.params
    return limits.velocity_stop_needed(
        state.pos_ned_m, state.vel_ned_m_s, view.percept.static_ne_m, params.vehicle.radius_m, params.limits
    )


def _facts(view: View) -> Facts:
    percept = view.percept
    return Facts(
        view.state.t_s,
        view.goal_m,
        percept.d_min_m,
        percept.s_fuzzy,
        percept.line_of_sight,
        line_done=False,
        fresh=True,
    )


def _perceived(memory: Memory, inputs: Inputs, task: Task, params: navigator.Params) -> Percept:
    grid = memory.grid if inputs.status.armed else gridmap.empty(params.map)  # as the navigator: see its tick
    tracks = memory.tracks if inputs.status.armed else ()
    return perceive(
        Remembered(memory.t_s, grid, tracks, memory.ground_down_m),
        inputs,
        task.goal_ned_m,
        params.vehicle.radius_m,
        params.perception,
        params.map,
        params.movers,
    )


def _ground(memory: Memory, inputs: Inputs) -> float:
    standing = not inputs.status.armed and inputs.status.landed == LandedState.ON_GROUND
    return float(inputs.state.pos_ned_m[2]) if standing else memory.ground_down_m


def _standby(memory: Memory, state: VehicleState) -> tuple[Memory, Setpoint, PilotNote]:
    """Not ours to fly: answer with where the vehicle is."""
    if memory.state is None:
        return memory, Setpoint(state.t_s, None, np.zeros(3), None, None), PilotNote(STANDBY)
    yaw = yaw_rad(state.q_ned_frd)
    setpoint = Setpoint(state.t_s, state.pos_ned_m.copy(), None, None, yaw)
    return replace(memory, engaged=None, yaw_sp_rad=yaw), setpoint, PilotNote(STANDBY)


def _engage(state: VehicleState, task: Task) -> Engaged:
    down_m = float(state.pos_ned_m[2]) if task.down_m is None else task.down_m
    return Engaged(state.pos_ned_m[:2].copy(), down_m)
