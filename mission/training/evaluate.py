"""How does a policy fly?  Greedy flights of whole missions in process, judged by the truth as every flight is.

Take-off to touchdown, success as the mission asks for it. A flight is a function of (policy, guard, world, seed).
"""

import functools
import math
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from companion import navigator
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import NavMode, Setpoint
from companion.policy.interface import Policy
from mission.flight_log import TruthLog, read_truth
from mission.flight_plan import FlightPlan
from mission.judge import Flown, failure_of, measure
from mission.shortest_path import shortest_path_m
from mission.side_by_side import side_by_side
from mission.simulate import InProcessFlight, fly_in_process
from mission.tables import TIMED_OUT
from mission.training.baselines import policy_for
from mission.training.flights import plan_in
from mission.training.scores import FlightFigures
from sitl.truth_log import TruthFile

WARMUP = 1  # decisions left out of the timing: the first one loads what is imported late


@dataclass(frozen=True, slots=True)
class EvalSpec:
    """What is to be flown, but for the seed."""

    policy: str  # a shipped name, a folder, or a baseline
    world: str  # a mission, a world file or a generator
    guard: bool = False  # the geometric expert's proposal is one more candidate of the checker

    def overrides(self) -> dict[str, dict[str, Any]]:
        """Of the companion's parameters: the expert's paths last less long than those of others."""
        return {"policy": {"name": self.policy, "guard": self.guard}}


@dataclass(slots=True)
class _Pilot:
    """The navigator's tick with this policy asked, and what is counted on the way."""

    policy: Policy
    verdicts: Counter[str] = field(default_factory=Counter)
    tick_ms: list[float] = field(default_factory=list)
    guarded: int = 0
    rl_time_s: float = 0.0
    t_s: float = 0.0  # of the last tick
    switches: int = 0
    switches_bound: int = 0

    def think(
        self, memory: navigator.Memory, inputs: Inputs, task: Task, params: navigator.Params
    ) -> tuple[navigator.Memory, Setpoint, navigator.Record]:
        """As ``navigator.tick``."""
        began_s = time.perf_counter()
        pending = navigator.sense(memory, inputs, task, params)
        answer = None
        if pending.query is not None:
            answer = navigator.Answer(*self.policy.propose(pending.query, pending.memory.policy))
        ticked = navigator.act(pending, answer)
        if pending.query is not None:
            self.tick_ms.append(1e3 * (time.perf_counter() - began_s))
        return ticked

    def count(self, record: navigator.Record) -> None:
        """Take in one tick's record."""
        engaged, t_s = record.memory.engaged, record.inputs.state.t_s
        if engaged is not None:
            self.switches, self.switches_bound = engaged.arbiter.switches, record.switches_bound
            self.rl_time_s += t_s - self.t_s if engaged.arbiter.mode == NavMode.RL else 0.0
        self.t_s = t_s
        if record.decision is not None:
            self.guarded += record.decision.guarded
            self.verdicts[str(record.decision.verdict.kind)] += 1


def fly_many(spec: EvalSpec, seeds: Sequence[int], jobs: int = 1) -> Iterator[FlightFigures]:
    """One flight a seed, in the order of the seeds, each as soon as it is there."""
    if jobs == 1:
        yield from (fly_one(spec, seed) for seed in seeds)
        return
    yield from side_by_side(functools.partial(fly_one, spec), seeds, jobs)


def fly_one(spec: EvalSpec, seed: int) -> FlightFigures:
    """One flight, judged. Raises InputError or ParamError about what cannot be flown."""
    plan = plan_in(spec.world, seed, spec.overrides())
    return fly_plan(plan, policy_for(spec.policy, plan.params, seed))


def fly_plan(plan: FlightPlan, policy: Policy) -> FlightFigures:
    """One flight of a plan with a policy, judged."""
    pilot = _Pilot(policy)
    flight = fly_in_process(plan, pilot.count, pilot.think)
    truth = _truth(flight)
    flown = measure(truth, plan.world.goal_ned_m)
    shortest_m = _shortest_m(plan, flown)
    trouble = TIMED_OUT.format(plan.mission.success.time_limit_s) if flight.timed_out else None
    failure = failure_of(flown, plan, shortest_m, trouble)
    return FlightFigures(
        seed=plan.seed,
        world=plan.world.name,
        success=failure is None,
        reason=failure or "landed",
        contact=flown.collisions > 0,
        timeout=flight.timed_out and flown.collisions == 0,
        time_s=flown.time_s,
        path_m=flown.path_m,
        shortest_m=shortest_m,
        min_clearance_m=flown.min_clearance_m if math.isfinite(flown.min_clearance_m) else None,
        jerk_m2_s6=mean_square_jerk(truth),
        switches=pilot.switches,
        switches_bound=pilot.switches_bound,
        rl_time_s=pilot.rl_time_s,
        verdicts=dict(pilot.verdicts),
        guarded=pilot.guarded,
        tick_ms=tuple(pilot.tick_ms[WARMUP:]),
    )


def mean_square_jerk(truth: TruthLog) -> float | None:
    """Over the flown part, horizontal, from velocities at the scans' instants [m2/s6]; None for less than three."""
    window = truth.flown
    t_s, vel_ned_m_s = truth.t_s[window], truth.vel_ned_m_s[window, :2]
    if len(t_s) < 3:
        return None
    dt_s = np.diff(t_s)[:, None]
    acc = np.diff(vel_ned_m_s, axis=0) / dt_s
    jerk = np.diff(acc, axis=0) / dt_s[1:]
    return float(np.mean(np.sum(jerk**2, axis=1)))


def _truth(flight: InProcessFlight) -> TruthLog:
    """The truth as the judge reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truth.jsonl"
        file = TruthFile(path, flight.sim.spawn_ned_m)
        file.write(flight.sim.rows)
        file.close()
        return read_truth(path)


def _shortest_m(plan: FlightPlan, flown: Flown) -> float | None:
    if flown.began_ned_m is None:
        return None
    shortest_m = shortest_path_m(plan.world, flown.began_ned_m, plan.world.goal_ned_m, plan.params.vehicle.radius_m)
    return shortest_m if 0.0 < shortest_m < math.inf else None
