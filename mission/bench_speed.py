"""How quick is all this on this machine?  Ratios to bare JSBSim stepping in the same run, so that machines compare.

``bare_rtf``           JSBSim alone, the aircraft flying, seconds of flight a second of CPU time
``in_process_rtf``     the same flight with autopilot, LiDAR (360 rays, 25 Hz, 60 obstacles) and clearance
``in_process_ratio``   in_process_rtf over bare_rtf
``closed_loop_rtf``    trajectory 2 with the navigator, in one process
``udp_lockstep_rtf``   trajectory 2 over UDP: vehicle, companion and operator as processes, OFFBOARD to touchdown
``tick_p99_ms``        of that flight's ticks in OFFBOARD without a decision; ``decision_p99_ms`` with one
``companion_rss_mb``   most memory that the companion's process held in it
"""

import math
import os
import platform
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from companion.core.types import Setpoint
from companion.navigator.record import STANDBY
from mission.console import FlightConsole, LogTail
from mission.errors import FlightError
from mission.flight_log import read_rows
from mission.flight_plan import FlightPlan, plan_flight
from mission.runner import FlySettings, fly, free_instance
from mission.simulate import fly_in_process
from sitl.modes import FlightMode
from sitl.simulation import STEP_MS, SimConfig, Simulation
from sitl.vehicle import Turbulence, Vehicle, Wind
from sitl.world import World

OBSTACLES = 60
ROUNDS = 5  # bare and full alternate; the median round counts
STRETCH_S = 10.0  # vehicle time of one round
SETTLE_S = 8.0  # take-off, not counted
SPEED_M_S = 3.0
WIND = Wind((2.0, 1.0, 0.0), Turbulence.LIGHT)
SCAN_S = 0.04  # 25 Hz


def measure(seed: int) -> dict[str, Any]:
    """All figures. Raises InputError for a port in use, FlightError when the flight over UDP did not end well."""
    instance = free_instance()
    plan = plan_flight("trajectory2", seed)
    bare_s, full_s = _stepping_s()
    return {
        "bare_rtf": STRETCH_S / bare_s,
        "in_process_rtf": STRETCH_S / full_s,
        "in_process_ratio": bare_s / full_s,
        "closed_loop_rtf": _closed_loop_rtf(plan),
        **_over_udp(plan, instance),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
    }


def _stepping_s() -> tuple[float, float]:
    """CPU time of one stretch: JSBSim alone, and the whole vehicle in its world."""
    vehicle, sim = _hovering(), _flying()
    rounds = [(_bare_s(vehicle), _full_s(sim)) for _ in range(ROUNDS)]
    bare_s, full_s = np.median(rounds, axis=0)
    return float(bare_s), float(full_s)


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


def _full_s(sim: Simulation) -> float:
    north_m, scans = float(sim.truth.pos_ned_m[0]), round(STRETCH_S / SCAN_S)
    began_s = time.process_time()
    for i in range(scans):
        place = np.array([north_m + SPEED_M_S * SCAN_S * i, 0.0, -2.5])
        sim.advance_to_scan()
        sim.submit(Setpoint(sim.t_s, place, None, None, 0.0))
    return time.process_time() - began_s


def _closed_loop_rtf(plan: FlightPlan) -> float:
    began_s = time.perf_counter()
    flight = fly_in_process(plan)
    return flight.sim.t_s / (time.perf_counter() - began_s)


def _over_udp(plan: FlightPlan, instance: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with FlightConsole("", LogTail(folder / "navigator.jsonl"), quiet=True) as console:
            result = fly(plan, FlySettings(instance=instance), folder, console)
        if not result.success:
            raise FlightError(f"the flight over UDP failed: {result.reason}")
        steered = {row["t_s"] for row in read_rows(folder / "navigator.jsonl") if row["mode"] != STANDBY}
        ticks = [row for row in read_rows(folder / "timing.jsonl") if row["t_s"] in steered]
        end = next(row for row in read_rows(folder / "companion.jsonl") if row.get("event") == "end")
    return {
        "udp_lockstep_rtf": result.realtime_factor,
        "tick_p99_ms": _p99([row["tick_ms"] for row in ticks if not row["decision"]]),
        "decision_p99_ms": _p99([row["tick_ms"] for row in ticks if row["decision"]]),
        "companion_rss_mb": end["max_rss_mb"],
    }


def _p99(values: list[float]) -> float | None:
    return float(np.percentile(values, 99)) if values else None
