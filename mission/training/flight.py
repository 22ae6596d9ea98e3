"""What is a training flight, whoever steers? The full vehicle from the ground on, rewards, and how it ended.

``Flight`` takes off without a pilot, hands over in the air and then goes from scan to scan; the pilot of the day
answers each scan with a setpoint and says what mode it is in. Truth alone decides how a flight ends and what is
measured. Vehicle time only: a flight is a function of its plan and of the answers.
"""

import math
import time
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from companion.core.types import Setpoint
from mission.flight_plan import FlightPlan
from mission.simulate import GROUND_LIMIT_S, sim_config
from mission.training import reward
from mission.training.reward import RewardState, TickFacts
from mission.training.reward_tables import PAPER_STEP_S, RewardTable
from mission.training.way_field import way_field
from sitl.modes import FlightMode
from sitl.simulation import Observation, SimConfig, Simulation

COS_TILT_MAX = math.cos(math.radians(60.0))  # "attitude violation"; the autopilot's own limit is 35 deg
HANDOVER_S = 0.4  # the pilot looks round before it takes over: two cycles of the LiDAR's dither
UP_M = 0.3  # nearer than this to the take-off height is up: to arrive there in wind may take ten seconds more
TRACK_EVERY = 5  # ticks between two places of the track that is kept


class End(StrEnum):
    """How a flight ended."""

    GOAL = "goal"
    CONTACT = "contact"
    OUT_OF_BOUNDS = "out_of_bounds"
    ATTITUDE = "attitude"
    NO_PROGRESS = "no_progress"  # only where the reward table says so
    GROUNDED = "grounded"  # landed or disarmed elsewhere
    TIMEOUT = "timeout"  # the only one that truncates


@dataclass(frozen=True, slots=True)
class FlightSpec:
    """What is flown, and when it is over."""

    plan: FlightPlan
    table: RewardTable
    time_limit_s: float = 90.0  # vehicle time from the hand-over
    latency_s: float = 0.05  # from scan to setpoint in force
    scan_latency_s: float = 0.0  # besides: how late a scan arrives
    scan_rate_hz: float = 25.0
    discount_per_s: float = 0.98


@dataclass(slots=True)
class Earned:
    """What came in since it was last taken: discounted and scaled sum, and the discount at its end."""

    reward: float = 0.0
    discount: float = 1.0
    ticks: int = 0


@dataclass(slots=True)
class Log:
    """What is measured of one flight, from the hand-over on."""

    ticks: int = 0
    path_m: float = 0.0
    min_clearance_m: float = math.inf
    rows: dict[str, float] = field(default_factory=dict)
    track_ne_m: list[tuple[float, float]] = field(default_factory=list)  # world


class Flight:
    """One flight: ``take_off``, then ``next_scan``, ``judge`` and ``answer`` in turn until ``end`` is set."""

    def __init__(self, spec: FlightSpec) -> None:
        self.spec = spec
        self.sim = Simulation(spec.plan.world, _config(spec))
        self.end: End | None = None
        self.log = Log()
        self.earned = Earned()
        self.engaged_t_s: float | None = None
        self.physics_s = 0.0  # wall time spent in the simulator: for people, it decides nothing
        self._goal_ne_m: list[float] = spec.plan.world.goal_ned_m.tolist()
        self._spawn_ned_m: list[float] = self.sim.spawn_ned_m.tolist()
        self._state: RewardState | None = None
        self._at_ne_m: tuple[float, float] | None = None

    @property
    def time_s(self) -> float:
        """Since the hand-over."""
        return 0.0 if self.engaged_t_s is None else self.sim.t_s - self.engaged_t_s

    @property
    def goal_m(self) -> float:
        """Horizontal distance to the goal, by truth."""
        return math.dist(self.world_ne_m, self._goal_ne_m)

    @property
    def world_ne_m(self) -> tuple[float, float]:
        """Where the vehicle is, by truth."""
        (north_m, east_m, _), (spawn_north_m, spawn_east_m, _) = self.sim.truth.pos_ned_m.tolist(), self._spawn_ned_m
        return spawn_north_m + north_m, spawn_east_m + east_m

    def take_off(self) -> Observation:
        """Arm and climb, as far as the height of the task; the first scan up there."""
        sim, autopilot = self.sim, self.sim.autopilot
        while sim.t_s < GROUND_LIMIT_S:
            seen = self.next_scan()
            if autopilot.has_flown and seen.state.pos_ned_m[2] < self._down_m() + UP_M:
                return seen
            if not autopilot.armed and autopilot.ready:
                autopilot.command_arm()
                autopilot.command_takeoff()
        raise RuntimeError(f"no take-off within {GROUND_LIMIT_S:g} s")

    def hand_over(self) -> None:
        """From now on the pilot flies; needs its setpoints to be coming in."""
        self.sim.autopilot.command_mode(FlightMode.OFFBOARD)
        self.engaged_t_s = self.sim.t_s
        self._at_ne_m = self.world_ne_m
        self.log.track_ne_m.append(self._at_ne_m)

    def next_scan(self) -> Observation:
        """Fly on to the next scan."""
        began_s = time.perf_counter()
        seen = self.sim.advance_to_scan()
        self.physics_s += time.perf_counter() - began_s
        return seen

    def answer(self, setpoint: Setpoint) -> None:
        """A companion's answer, as it arrives by the wire."""
        self.sim.submit(setpoint)

    def judge(self, facts: TickFacts, arrived: bool) -> None:
        """Measure and pay one tick, see whether it was the last; ``arrived``: the pilot's own idea of the goal."""
        self.end = self._ending(arrived)
        facts = TickFacts(
            facts.t_s,
            facts.pos_ne_m,
            self.goal_m,
            facts.d_min_m,
            facts.mode,
            facts.endpoint_ne_m,
            way_s=self._way_s(),
            cross_track_m=facts.cross_track_m,
            contact=self.end is End.CONTACT,
            failure=self.end in (End.OUT_OF_BOUNDS, End.ATTITUDE),
        )
        self._measure()
        if self._state is None:
            self._state = reward.start(facts)
            return
        table = self.spec.table
        before_s = self._state.t_s
        self._state, rows = reward.step(self._state, facts, table)
        for name, value in rows.items():
            self.log.rows[name] = self.log.rows.get(name, 0.0) + value
        earned = self.earned
        earned.reward += earned.discount * table.scale * sum(rows.values())
        earned.discount *= self.spec.discount_per_s ** (facts.t_s - before_s)
        earned.ticks += 1
        if self.end is None and reward.ends(self._state, table):
            self.end = End.NO_PROGRESS

    def take_earned(self) -> Earned:
        """What came in since the last call."""
        earned, self.earned = self.earned, Earned()
        return earned

    def figures(self) -> dict[str, Any]:
        """What is said of a flight that is over, whoever flew it."""
        return {
            "success": self.end is End.GOAL,
            "contact": self.end is End.CONTACT,
            "timeout": self.end is End.TIMEOUT,
            "out_of_bounds": self.end is End.OUT_OF_BOUNDS,
            "end": str(self.end),
            "world": self.spec.plan.world.name,
            "seed": self.spec.plan.seed,
            "steps": round(self.time_s / PAPER_STEP_S),
            "ticks": self.log.ticks,
            "time_s": round(self.time_s, 3),
            "path_m": self.log.path_m,
            "min_clearance_m": self.log.min_clearance_m,
            "return": sum(self.log.rows.values()),
            "rows": dict(self.log.rows),
            "track_ne_m": list(self.log.track_ne_m),
        }

    def _way_s(self) -> float:
        """What the rest of the way would take; 0 where the table does not ask."""
        spec = self.spec
        if spec.table.way == 0.0:
            return 0.0
        field = way_field(spec.plan.world, spec.plan.params.vehicle.radius_m, spec.plan.mission.cruise_m_s)
        return field.at(*self.world_ne_m)

    def _down_m(self) -> float:
        task_down_m = self.spec.plan.task.down_m
        return -float(self.sim.autopilot.params["MIS_TAKEOFF_ALT"]) if task_down_m is None else task_down_m

    def _ending(self, arrived: bool) -> End | None:
        truth, (north_m, east_m) = self.sim.truth, self.world_ne_m
        if self.sim.contact:
            return End.CONTACT
        if arrived:
            return End.GOAL
        if not self.spec.plan.world.inside(north_m, east_m):
            return End.OUT_OF_BOUNDS
        _, x, y, _ = truth.q_ned_frd.tolist()
        if 1.0 - 2.0 * (x * x + y * y) < COS_TILT_MAX:  # cosine of the tilt
            return End.ATTITUDE
        if self.sim.finished:
            return End.GROUNDED
        return End.TIMEOUT if self.time_s >= self.spec.time_limit_s else None

    def _measure(self) -> None:
        here, log = self.world_ne_m, self.log
        log.ticks += 1
        if self._at_ne_m is not None:
            log.path_m += math.dist(here, self._at_ne_m)
        self._at_ne_m = here
        if not self.sim.truth.on_ground:
            log.min_clearance_m = min(log.min_clearance_m, self.sim.rows[-1].clearance_m)
        if log.ticks % TRACK_EVERY == 0 or self.end is not None:
            log.track_ne_m.append(here)


def _config(spec: FlightSpec) -> SimConfig:
    config = sim_config(spec.plan)
    lidar = replace(config.lidar, latency_s=spec.scan_latency_s, rate_hz=spec.scan_rate_hz)
    return replace(config, latency_s=spec.latency_s, lidar=lidar)
