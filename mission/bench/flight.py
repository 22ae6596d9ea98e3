"""What happens when one pilot flies one course? The full vehicle in process, judged by truth alone.

The harness takes off, places the vehicle hovering at the start (or brings it there at speed) and hands over; the pilot
answers every scan as a companion does: same quantisation, same latency. Truth says how the flight ends. But for the
wall times of decisions a flight is a function of (course, pilot, parameters, stress, seed).
"""

import math
import time
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final

import numpy as np

from companion import navigator
from companion.core.codec import quantise_setpoint
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import F64, Setpoint
from mission.bench.course import Course, Rules
from mission.bench.stress import NONE, Stress
from mission.errors import FlightError
from mission.pilots.interface import Oracle, Pilot, PilotNote
from sitl.lidar import LidarParams
from sitl.modes import FlightMode
from sitl.simulation import Observation, SimConfig, Simulation

GROUND_LIMIT_S: Final = 60.0
LOOK_S: Final = 0.4  # the pilot looks round in hover: two cycles of the LiDAR's dither
RUN_UP_M_S2: Final = 4.0
RUN_UP_STEADY_S: Final = 1.5  # at speed before the start
STANDING_M_S: Final = 0.2  # slower than this the vehicle stands: what touches it then has come by itself
TOUCHING_M: Final = 0.1  # a mover this near to the hull at the end of a scan period is what touched it


class End(StrEnum):
    """How a flight ended."""

    GOAL = "goal"
    CONTACT = "contact"  # the vehicle moved
    STRUCK = "struck"  # it stood, and something drove into it
    OUT_OF_BOUNDS = "out_of_bounds"
    LOST = "lost"  # the autopilot no longer flies the pilot's setpoints
    TIMEOUT = "timeout"


@dataclass(slots=True)
class Flown:
    """One flight, as it was measured; world ned."""

    end: End
    time_s: float
    start_speed_m_s: float  # when the pilot took over
    track: F64  # (n, 4) vehicle time since the hand-over, north, east, speed; one row a scan
    vel_ned_m_s: F64  # (n, 2)
    min_clearance_m: float
    switches: int
    switches_bound: int | None
    decision_ms: list[float]
    tick_ms: list[float]  # of the others
    modes: list[str]  # one a scan
    last: PilotNote
    spawn_ned_m: F64
    seen_ne_m: F64  # (k, 2) last scan's hits


@dataclass(slots=True)
class _Log:
    track: list[tuple[float, float, float, float]] = field(default_factory=list)
    vel: list[tuple[float, float]] = field(default_factory=list)
    decision_ms: list[float] = field(default_factory=list)
    tick_ms: list[float] = field(default_factory=list)
    modes: list[str] = field(default_factory=list)
    clearance_m: float = math.inf


def fly(
    course: Course,
    pilot: Pilot,
    params: navigator.Params,
    seed: int,
    stress: Stress = NONE,
    px4_params: dict[str, float] | None = None,
) -> Flown:
    """One flight. Raises FlightError when the vehicle does not come to the start."""
    draws = np.random.SeedSequence(seed).spawn(2)
    start = _start_place(course, np.random.default_rng(draws[0]))
    back_m = _run_up_m(course.rules.speed_m_s) if course.rules.at_speed else 0.0
    spawn = start - (back_m, 0.0)
    sim = Simulation(course.world, _config(course, spawn, int(draws[1].generate_state(1)[0]), stress, px4_params or {}))
    _take_off(sim)
    offset = course.sent_to_ned_m - spawn
    task = Task(np.round(offset, 6), -course.rules.altitude_m, course.rules.speed_m_s)
    if isinstance(pilot, Oracle):
        pilot = pilot.told(course.world, spawn)
    memory = pilot.start(params)
    if back_m:
        seen = _run_up(sim, back_m, course.rules)
    else:
        memory, seen = _look_round(sim, pilot, memory, task, params, stress)
    return _fly_on(sim, seen, course, pilot, memory, task, params, stress)


def _config(course: Course, spawn: F64, seed: int, stress: Stress, px4_params: dict[str, float]) -> SimConfig:
    rules = course.rules
    return SimConfig(
        seed=seed,
        spawn_ned_m=(float(spawn[0]), float(spawn[1])),
        spawn_yaw_rad=course.yaw_rad,
        latency_s=0.05 if stress.latency_s is None else stress.latency_s,
        radius_m=rules.radius_m,
        lidar=LidarParams(
            rate_hz=rules.rate_hz if stress.rate_hz is None else stress.rate_hz,
            range_max_m=rules.range_m,
            sigma_m=rules.sigma_m if stress.sigma_m is None else stress.sigma_m,
            dropout=stress.dropout,
        ),
        px4_params={"MIS_TAKEOFF_ALT": rules.altitude_m, **px4_params},
        faults=stress.faults,
    )


def _start_place(course: Course, rng: np.random.Generator) -> F64:
    """Uniform over the disc round the course's start."""
    away_m = course.rules.jitter_m * math.sqrt(rng.uniform())
    bearing_rad = rng.uniform(-math.pi, math.pi)
    place: F64 = course.world.start_ned_m + away_m * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    return place


def _take_off(sim: Simulation) -> Observation:
    autopilot = sim.autopilot
    while sim.t_s < GROUND_LIMIT_S:
        seen = sim.advance_to_scan()
        if autopilot.has_flown and autopilot.mode is FlightMode.HOLD:
            return seen
        if not autopilot.armed and autopilot.ready:
            autopilot.command_arm()
            autopilot.command_takeoff()
    raise FlightError(f"no take-off within {GROUND_LIMIT_S:g} s")


def _look_round(
    sim: Simulation, pilot: Pilot, memory: Any, task: Task, params: navigator.Params, stress: Stress
) -> tuple[Any, Observation]:
    """Hover for a moment with the pilot looking on, then hand over."""
    began_s = sim.t_s
    hold = Setpoint(sim.t_s, np.array([0.0, 0.0, task.down_m]), None, None, sim.config.spawn_yaw_rad)
    while True:
        seen = sim.advance_to_scan()
        sim.submit(_at(hold, seen.state.t_s))
        if sim.t_s - began_s >= LOOK_S:
            sim.autopilot.command_mode(FlightMode.OFFBOARD)
            return memory, sim.advance_to_scan()
        memory, _, _ = pilot.tick(memory, _inputs(seen, stress), task, params)


def _run_up_m(speed_m_s: float) -> float:
    return speed_m_s * speed_m_s / (2.0 * RUN_UP_M_S2) + speed_m_s * RUN_UP_STEADY_S


def _run_up(sim: Simulation, back_m: float, rules: Rules) -> Observation:
    """North along the line until the start is reached at speed; the pilot has seen nothing yet."""
    hold = Setpoint(sim.t_s, np.array([0.0, 0.0, -rules.altitude_m]), None, None, 0.0)
    for _ in range(2):
        sim.submit(_at(hold, sim.advance_to_scan().state.t_s))
    sim.autopilot.command_mode(FlightMode.OFFBOARD)
    began_s = sim.t_s
    while sim.t_s - began_s < GROUND_LIMIT_S:
        seen = sim.advance_to_scan()
        if sim.truth.pos_ned_m[0] >= back_m:
            return seen
        s, v, a = _ramp(seen.state.t_s + sim.config.latency_s - began_s, rules.speed_m_s)
        here = np.array([s, 0.0, -rules.altitude_m])
        sim.submit(
            quantise_setpoint(Setpoint(seen.state.t_s, here, np.array([v, 0.0, 0.0]), np.array([a, 0.0, 0.0]), 0.0))
        )
    raise FlightError(f"the start was not reached within {GROUND_LIMIT_S:g} s")


def _ramp(t_s: float, speed_m_s: float) -> tuple[float, float, float]:
    """Way, speed, acceleration."""
    rise_s = speed_m_s / RUN_UP_M_S2
    if t_s < rise_s:
        return RUN_UP_M_S2 * t_s * t_s / 2.0, RUN_UP_M_S2 * t_s, RUN_UP_M_S2
    return speed_m_s * (t_s - rise_s / 2.0), speed_m_s, 0.0


def _fly_on(
    sim: Simulation,
    seen: Observation,
    course: Course,
    pilot: Pilot,
    memory: Any,
    task: Task,
    params: navigator.Params,
    stress: Stress,
) -> Flown:
    """From the hand-over to the end."""
    log, began_s = _Log(), sim.t_s
    start_speed = math.hypot(*sim.truth.vel_ned_m_s[:2].tolist())
    while True:
        end = _end(sim, course, began_s)
        _measure(log, sim, began_s)
        inputs = _inputs(seen, stress)
        clock_s = time.perf_counter()
        memory, setpoint, note = pilot.tick(memory, inputs, task, params)
        took_ms = 1e3 * (time.perf_counter() - clock_s)
        (log.decision_ms if note.decided else log.tick_ms).append(took_ms)
        log.modes.append(note.mode)
        if end is not None:
            return _flown(end, sim, log, note, inputs, start_speed)
        sim.submit(quantise_setpoint(setpoint))
        seen = sim.advance_to_scan()


def _end(sim: Simulation, course: Course, began_s: float) -> End | None:
    north_m, east_m, _ = (sim.truth.pos_ned_m + sim.spawn_ned_m).tolist()
    if sim.contact:
        return End.STRUCK if _stood_in_the_way(sim, north_m, east_m) else End.CONTACT
    if course.finished(north_m, east_m):
        return End.GOAL
    if not course.world.inside(north_m, east_m):
        return End.OUT_OF_BOUNDS
    if sim.autopilot.mode is not FlightMode.OFFBOARD:
        return End.LOST
    return End.TIMEOUT if sim.t_s - began_s >= course.rules.time_limit_s else None


def _stood_in_the_way(sim: Simulation, north_m: float, east_m: float) -> bool:
    """Did the vehicle stand, and is what touches it something that moves?"""
    if math.hypot(*sim.truth.vel_ned_m_s[:2].tolist()) >= STANDING_M_S:
        return False
    gaps = (math.dist(m.position_ned_m(sim.world_s), (north_m, east_m)) - m.radius_m for m in sim.world.movers)
    return min(gaps, default=math.inf) <= sim.config.radius_m + TOUCHING_M


def _measure(log: _Log, sim: Simulation, began_s: float) -> None:
    truth = sim.truth
    north_m, east_m, _ = (truth.pos_ned_m + sim.spawn_ned_m).tolist()
    vn, ve, _ = truth.vel_ned_m_s.tolist()
    log.track.append((sim.t_s - began_s, north_m, east_m, math.hypot(vn, ve)))
    log.vel.append((vn, ve))
    log.clearance_m = min(log.clearance_m, sim.rows[-1].clearance_m)


def _flown(end: End, sim: Simulation, log: _Log, note: PilotNote, inputs: Inputs, start_speed: float) -> Flown:
    return Flown(
        end=end,
        time_s=round(log.track[-1][0], 3),
        start_speed_m_s=start_speed,
        track=np.array(log.track),
        vel_ned_m_s=np.array(log.vel),
        min_clearance_m=log.clearance_m,
        switches=note.switches,
        switches_bound=note.switches_bound,
        decision_ms=log.decision_ms,
        tick_ms=log.tick_ms,
        modes=log.modes,
        last=note,
        spawn_ned_m=sim.spawn_ned_m,
        seen_ne_m=_hits(inputs, sim.spawn_ned_m),
    )


def _hits(inputs: Inputs, spawn_ned_m: F64) -> F64:
    """The last scan as points of the world, level flight assumed; for the picture."""
    scan, state = inputs.scan, inputs.state
    w, x, y, z = state.q_ned_frd.tolist()
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    hit = np.flatnonzero(np.isfinite(scan.range_m))
    way = yaw + scan.angle_offset_rad + hit * scan.increment_rad
    offsets = scan.range_m[hit][:, None] * np.stack([np.cos(way), np.sin(way)], axis=1)
    points: F64 = state.pos_ned_m[:2] + spawn_ned_m[:2] + offsets
    return points


def _inputs(seen: Observation, stress: Stress) -> Inputs:
    return Inputs(seen.state, stress.seen(seen.scan), seen.status)


def _at(setpoint: Setpoint, t_s: float) -> Setpoint:
    return quantise_setpoint(
        Setpoint(t_s, setpoint.pos_ned_m, setpoint.vel_ned_m_s, setpoint.acc_ned_m_s2, setpoint.yaw_rad)
    )
