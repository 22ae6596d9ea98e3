"""Worlds, inputs and whole flights for tests of the navigator: the simulator's LiDAR at made-up or flown poses."""

import dataclasses
import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from companion import navigator
from companion.core.frames import quaternion
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import AutopilotStatus, LandedState, VehicleState
from companion.navigator import Memory, Params, Record
from companion.policy.expert import GeometricExpert
from mission.flight_plan import FlightPlan, plan_flight
from mission.simulate import fly_in_process
from sitl.lidar import Lidar, LidarParams
from sitl.world import Mover, World

DT_S = 0.04
PARAMS = Params()
FLYING = AutopilotStatus(armed=True, offboard=True, landed=LandedState.IN_AIR)
HOVERING = AutopilotStatus(armed=True, offboard=False, landed=LandedState.IN_AIR)
DOWN_M = -2.5
SAMPLE_EVERY = 9  # ticks


CLUTTER = ((3.5, 0.3, 0.3), (3.0, -2.2, 0.4), (3.2, 2.6, 0.4), (6.0, 1.6, 0.3), (6.5, -1.0, 0.4), (-2.5, 2.0, 0.3))


def world(circles: Any = (), boxes: Any = (), movers: tuple[Mover, ...] = ()) -> World:
    """Circles are (north, east, radius), boxes (north, east, yaw, half length, half width); all tall."""
    tall = [(*row, np.inf) for row in circles]
    walls = [(*row, np.inf) for row in boxes]
    return World(
        "scene",
        np.zeros(2),
        np.array([30.0, 0.0]),
        (-100.0, -100.0, 100.0, 100.0),
        np.array(tall, dtype=float).reshape(-1, 4),
        np.array(walls, dtype=float).reshape(-1, 6),
        movers,
    )


def ring(radius_m: float, count: int = 24, at: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, float, float]]:
    """Trunks all round a place: their surfaces ``radius_m`` away."""
    around = np.arange(count) * np.pi * 2 / count
    far = radius_m + 0.2
    return [(at[0] + far * float(np.cos(a)), at[1] + far * float(np.sin(a)), 0.2) for a in around]


@dataclass
class Eye:
    """Looks round in a world: the inputs of a tick at any pose."""

    world: World
    sigma_m: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        self._lidar = Lidar(self.world, LidarParams(sigma_m=self.sigma_m), self.seed)

    def inputs(
        self,
        t_s: float,
        pos_ned_m: Any = (0.0, 0.0, DOWN_M),
        vel_ned_m_s: Any = (0.0, 0.0, 0.0),
        yaw_rad: float = 0.0,
        status: AutopilotStatus = FLYING,
        fresh: bool = True,
    ) -> Inputs:
        pos, q = np.array(pos_ned_m, dtype=float), quaternion(0.0, 0.0, yaw_rad)
        state = VehicleState(t_s, pos, np.array(vel_ned_m_s, dtype=float), q, np.zeros(3))
        return Inputs(state, self._lidar.scan(t_s, pos, q), status, fresh)


class Pilot:
    """Feeds ticks to the navigator and remembers."""

    def __init__(self, eye: Eye, task: Task | None = None, params: Params = PARAMS) -> None:
        self.eye, self.params = eye, params
        self.task = task or Task(np.array([30.0, 0.0]), None, 3.0)
        self.memory = navigator.start(params)
        self.t_s = 1.0

    def tick(self, **given: Any) -> Record:
        """One tick, one scan period after the last."""
        self.t_s = round(self.t_s + DT_S, 6)
        return self.take(self.eye.inputs(self.t_s, **given))

    def take(self, inputs: Inputs) -> Record:
        self.memory, _, record = navigator.tick(self.memory, inputs, self.task, self.params)
        return record

    def ticks(self, count: int, **given: Any) -> list[Record]:
        return [self.tick(**given) for _ in range(count)]


def bytes_of(value: Any) -> bytes:
    """Everything in a value, arrays byte for byte; equal only for values equal to the last bit."""
    if dataclasses.is_dataclass(value):
        fields = [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
        return type(value).__name__.encode() + b"(" + b",".join(n.encode() + bytes_of(v) for n, v in fields) + b")"
    if isinstance(value, np.ndarray):
        return repr((value.dtype.str, value.shape)).encode() + value.tobytes()
    if isinstance(value, tuple | list):
        return b"[" + b",".join(map(bytes_of, value)) + b"]"
    return repr(value).encode()


@dataclass(frozen=True)
class Flight:
    """A flight flown once a test run. A record holds its maps only in ``samples``: all of them fill 300 MB."""

    plan: FlightPlan
    records: list[Record]  # every tick, without maps
    samples: list[tuple[Memory, Record]]  # memory before a tick, and the whole record of it


@functools.cache
def flight(mission: str, seed: int) -> Flight:
    """The whole flight in process."""
    flown = Flight(plan_flight(mission, seed, policy=GeometricExpert.name), [], [])
    before = navigator.start(flown.plan.params)

    def keep(record: Record) -> None:
        nonlocal before
        asked = record.decision is not None and record.memory.decisions % 5 == 0
        if asked or len(flown.records) % SAMPLE_EVERY == 0:
            flown.samples.append((before, record))
        flown.records.append(_without_maps(record))
        before = record.memory

    fly_in_process(flown.plan, keep)
    return flown


def _without_maps(record: Record) -> Record:
    none: Any = None
    percept, memory = replace(record.percept, grid=none), replace(record.memory, grid=none)
    return replace(record, percept=percept, memory=memory)
