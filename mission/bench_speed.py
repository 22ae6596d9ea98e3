"""How quick is all this on this machine?  Ratios to bare JSBSim stepping in the same run, so that machines compare.

``FIGURES`` says what each figure means. What runs in this process is measured in CPU time, bare and full in turns, and
the median round counts; whole flights are measured by the wall, each from the command line on, and the median flight
counts. Other work on the machine slows both: ``load`` says how much of it there was.
"""

import math
import os
import platform
import time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from companion import navigator
from companion.core.inputs import Inputs
from companion.core.types import F64, Setpoint
from companion.navigator.record import STANDBY
from mission.bench_flights import Flown, fly_once
from mission.flight_plan import FlightPlan, plan_flight
from mission.simulate import fly_in_process
from sitl.modes import FlightMode
from sitl.simulation import STEP_MS, SimConfig, Simulation
from sitl.vehicle import Turbulence, Vehicle, Wind
from sitl.world import World

FIGURES: Final = {
    "bare_rtf": "JSBSim alone, the aircraft flying: seconds of flight a second of CPU time",
    "in_process_rtf": "the same with autopilot, LiDAR (360 rays, 25 Hz, 60 obstacles) and clearance",
    "in_process_ratio": "the latter over the former",
    "closed_loop_rtf": "trajectory 2 with the navigator, in one process, a second of CPU time",
    "udp_lockstep_rtf": "trajectory 2 over UDP: vehicle, companion and operator, OFFBOARD to the end",
    "tick_p50_ms": "trajectory 2's inputs ticked alone, in OFFBOARD, no decision; of each tick's turns the median",
    "tick_p99_ms": "of the same ticks",
    "decision_p99_ms": "of those with a decision",
    "flight_tick_p50_ms": "as it was in the flight over UDP, three processes on this machine's cores, by the wall",
    "flight_tick_p99_ms": "of the same ticks",
    "flight_decision_p99_ms": "of those with a decision",
    "companion_rss_mb": "most memory that the companion held in it",
    "first_setpoint_s": "from the command line to the first setpoint",
    "flight_wall_s": "from the command line to its end, pictures drawn",
    "load": "mean number of processes that wanted to run, in the minute before",
    "python": "version",
    "machine": "on which all this was measured",
}
OBSTACLES = 60
ROUNDS = 25  # bare and full alternate
STRETCH_S = 4.0  # vehicle time of one round
SETTLE_S = 8.0  # take-off, not counted
SPEED_M_S = 3.0
WIND = Wind((2.0, 1.0, 0.0), Turbulence.LIGHT)
SCAN_S = 0.04  # 25 Hz
FLIGHTS = 3
TURNS = 5  # of the same inputs
STANDING_BY, PLAIN, DECIDED = range(3)


def measure(seed: int, policy: str | None = None) -> dict[str, Any]:
    """All ``FIGURES``, flown by the mission's policy or by another.

    Raises InputError for a port in use or an unknown policy, FlightError when a flight over UDP did not end well.
    """
    plan = plan_flight("trajectory2", seed, policy=policy)
    load = os.getloadavg()[0]
    rounds = _rounds_s()
    return {
        "bare_rtf": STRETCH_S / float(np.median(rounds[:, 0])),
        "in_process_rtf": STRETCH_S / float(np.median(rounds[:, 1])),
        "in_process_ratio": float(np.median(rounds[:, 0] / rounds[:, 1])),
        **_closed_loop(plan),
        **_medians([fly_once(plan.mission.name, seed, plan.mission.policy) for _ in range(FLIGHTS)]),
        "load": load,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
    }


def _medians(flights: list[Flown]) -> dict[str, float]:
    return {name: float(np.median([getattr(flown, name) for flown in flights])) for name in Flown._fields}


def _rounds_s() -> F64:
    """(ROUNDS, 2) CPU time of one stretch: JSBSim alone, and the whole vehicle in its world."""
    vehicle, sim = _hovering(), _flying()
    return np.array([(_bare_s(vehicle), _full_s(sim, back=i % 2 == 1)) for i in range(ROUNDS)])


def _hovering() -> Vehicle:
    vehicle = Vehicle(STEP_MS / 1e3)
    vehicle.reset(1, wind=WIND)
    vehicle.set_motors(True)
    vehicle.command_position((0.0, 0.0, -3.0), None, None, 0.0, math.nan)
    vehicle.step(round(SETTLE_S * 1e3 / STEP_MS))
    return vehicle


def _flying() -> Simulation:
    """Up at 2.5 m in OFFBOARD, on the way through sixty trunks."""
    sim = Simulation(_sixty_trunks(), SimConfig(seed=1, wind=WIND))
    while sim.autopilot.mode is not FlightMode.OFFBOARD:
        sim.advance_to_scan()
        sim.submit(Setpoint(sim.t_s, np.array([0.0, 0.0, -2.5]), None, None, 0.0))
        if sim.autopilot.ready and not sim.autopilot.armed:
            sim.autopilot.command_arm()
            sim.autopilot.command_mode(FlightMode.OFFBOARD)
    while sim.t_s < SETTLE_S:
        sim.advance_to_scan()
        sim.submit(Setpoint(sim.t_s, np.array([0.0, 0.0, -2.5]), None, None, 0.0))
    return sim


def _sixty_trunks() -> World:
    """Trunks beside a lane that is free: contact is not what is measured."""
    rng = np.random.default_rng(0)
    north_m = rng.uniform(0.0, 200.0, OBSTACLES)
    east_m = rng.choice((-1.0, 1.0), OBSTACLES) * rng.uniform(1.5, 12.0, OBSTACLES)
    circles = np.column_stack([north_m, east_m, np.full(OBSTACLES, 0.3), np.full(OBSTACLES, np.inf)])
    bounds_m = (-10.0, -20.0, 300.0, 20.0)
    return World("sixty", np.zeros(2), np.array([200.0, 0.0]), bounds_m, circles, np.empty((0, 6)))


def _bare_s(vehicle: Vehicle) -> float:
    began_s = time.process_time()
    vehicle.step(round(STRETCH_S * 1e3 / STEP_MS))
    return time.process_time() - began_s


def _full_s(sim: Simulation, back: bool) -> float:
    """There along the lane, and back."""
    north_m, scans = float(sim.truth.pos_ned_m[0]), round(STRETCH_S / SCAN_S)
    step_m = SPEED_M_S * SCAN_S * (-1 if back else 1)
    began_s = time.process_time()
    for i in range(scans):
        place = np.array([north_m + step_m * i, 0.0, -2.5])
        sim.advance_to_scan()
        sim.submit(Setpoint(sim.t_s, place, None, None, 0.0))
    return time.process_time() - began_s


def _closed_loop(plan: FlightPlan) -> dict[str, float]:
    """A flight in this process, and the navigator alone on the inputs of that flight."""
    inputs: list[Inputs] = []
    began_s = time.process_time()
    flight = fly_in_process(plan, lambda record: inputs.append(record.inputs))
    rtf = flight.sim.t_s / (time.process_time() - began_s)
    turns = [_ticks_ms(plan, inputs) for _ in range(TURNS)]
    cost_ms = np.median([ms for ms, _ in turns], axis=0)
    kind = turns[0][1]
    return {
        "closed_loop_rtf": rtf,
        "tick_p50_ms": float(np.median(cost_ms[kind == PLAIN])),
        "tick_p99_ms": float(np.percentile(cost_ms[kind == PLAIN], 99)),
        "decision_p99_ms": float(np.percentile(cost_ms[kind == DECIDED], 99)),
    }


def _ticks_ms(plan: FlightPlan, inputs: list[Inputs]) -> tuple[F64, NDArray[np.int8]]:
    """Wall time of each tick, and of which kind it was: standing by, plain, with a decision."""
    memory = navigator.start(plan.params)
    took_s, kind = np.empty(len(inputs)), np.empty(len(inputs), np.int8)
    for i, seen in enumerate(inputs):
        began_s = time.perf_counter()
        memory, _, record = navigator.tick(memory, seen, plan.task, plan.params)
        took_s[i] = time.perf_counter() - began_s
        kind[i] = STANDING_BY if record.mode == STANDBY else DECIDED if record.decision is not None else PLAIN
    return took_s * 1e3, kind
