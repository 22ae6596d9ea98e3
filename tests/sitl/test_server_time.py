"""Whose time is it? Lockstep, gates and the end of a flight, over real sockets."""

import math
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mav
from server_kit import Client, forest, vehicle

from companion.core.clock import ManualClock
from companion.core.codec import decode_status, encode_setpoint
from companion.core.mavlink import Connection
from companion.core.tlog import read_tlog
from companion.core.transport import pair
from companion.core.types import AutopilotStatus, Setpoint
from sitl.gates import Gate, GateKeeper
from sitl.link import SPECS, Link
from sitl.modes import FlightMode
from sitl.server import RunConfig, Server
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import truth_line

OPERATOR = SPECS[1]
LOCKSTEP = RunConfig(speed=math.inf, lockstep=True, gates=True)


def fly_gated(instance: int, log_dir: Path, run: RunConfig = LOCKSTEP) -> tuple[bytes, list[Any]]:
    """The whole gated flight: 8 m north and down; truth and what the companion saw."""
    log_dir.mkdir()
    with vehicle(instance, run, log_dir):
        companion = Client(14540 + instance, 14580 + instance, 1, 191)
        operator = Client(14030 + instance, 14280 + instance)
        stop = threading.Event()
        thread = threading.Thread(target=_answer_scans, args=(companion, stop))
        thread.start()
        try:
            operator.ready()
            assert operator.command(400, 1.0) == 0
            assert operator.command(22) == 0
            operator.mode(FlightMode.HOLD)
            assert operator.command(176, 1.0, 6.0) == 0
            operator.until(lambda m: m.get_type() == "HEARTBEAT" and not m.base_mode & 128, 30.0)
        finally:
            stop.set()
            thread.join()
        companion.close()
        operator.close()
    keep = ("HEARTBEAT", "EXTENDED_SYS_STATE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "OBSTACLE_DISTANCE")
    return (log_dir / "truth.jsonl").read_bytes(), [m for m in companion.seen if m.get_type() in keep]


def _answer_scans(companion: Client, stop: threading.Event) -> None:
    while not stop.is_set():
        for message in companion.poll():
            if message.get_type() == "OBSTACLE_DISTANCE":
                companion.send(encode_setpoint(answer(message.time_usec // 1000)))


def answer(scan_ms: int) -> Setpoint:
    """What the companion of these flights wants at a scan: 8 m north, then down."""
    north_m = min(8.0, max(0.0, (scan_ms - 8000) / 400))
    return Setpoint(scan_ms / 1e3, np.array([north_m, 0.0, -2.5 if scan_ms < 14_000 else 1.0]), None, None, 0.0)


def fly_in_process() -> tuple[bytes, list[AutopilotStatus]]:
    """The same flight without sockets."""
    sim, gates, statuses = Simulation(forest(), SimConfig(seed=5)), GateKeeper(companion=False), []
    at_gate: dict[Gate | None, Callable[[], Any]] = {
        Gate.ARM: sim.autopilot.command_arm,
        Gate.TAKEOFF: sim.autopilot.command_takeoff,
        Gate.OFFBOARD: lambda: sim.autopilot.command_mode(FlightMode.OFFBOARD),
    }
    while (gate := gates.waiting(sim)) is not Gate.END:
        if gate in at_gate:
            at_gate[gate]()
            continue
        statuses.append(sim.advance_to_scan().status)
        sim.submit(answer(sim.t_ms))
    text = "".join(truth_line(row, sim.spawn_ned_m) + "\n" for row in sim.rows)
    return text.encode(), statuses


def test_two_lockstep_flights_over_udp_have_the_same_truth_and_the_same_scans(tmp_path: Path) -> None:
    first, seen = fly_gated(216, tmp_path / "a")
    again, _ = fly_gated(216, tmp_path / "b")
    assert first == again
    inside, statuses = fly_in_process()
    assert first == inside, "and so has the flight without sockets"
    assert first.count(b"\n") > 300
    scans = [i for i, m in enumerate(seen) if m.get_type() == "OBSTACLE_DISTANCE"]
    for i in scans:
        kinds = [m.get_type() for m in seen[i - 4 : i]]
        assert kinds == ["HEARTBEAT", "EXTENDED_SYS_STATE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED"]
        heard = decode_status(seen[i - 4], seen[i - 3])
        assert heard == statuses[seen[i].time_usec // 40_000 - 1]
        assert seen[i - 1].time_boot_ms * 1000 == seen[i - 2].time_boot_ms * 1000 == seen[i].time_usec
    packets = list(read_tlog(tmp_path / "a" / "vehicle_companion.tlog"))
    assert len(packets) > 5 * len(scans)


def test_the_last_scan_of_a_paced_flight_comes_after_the_news_that_it_is_over(tmp_path: Path) -> None:
    _, seen = fly_gated(229, tmp_path / "a", RunConfig(speed=20.0, gates=True))
    last = max(i for i, m in enumerate(seen) if m.get_type() == "OBSTACLE_DISTANCE")
    heartbeats = [m for m in seen[:last] if m.get_type() == "HEARTBEAT"]
    assert not heartbeats[-1].base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED


def test_lockstep_without_answers_goes_on_paced_and_says_so_once() -> None:
    with vehicle(217, RunConfig(speed=math.inf, lockstep=True)) as server:
        client = Client(14540 + 217, 14580 + 217)
        client.told("Lockstep off: no setpoint in 2 s")
        before_s = server.sim.t_s
        time.sleep(0.5)
        assert server.sim.t_s - before_s == pytest.approx(0.5, abs=0.3)
        assert [t for t in client.texts() if t.startswith("Lockstep")] == ["Lockstep off: no setpoint in 2 s"]
        client.close()


def test_the_clock_stands_at_a_gate_while_heartbeats_go_on() -> None:
    with vehicle(218, LOCKSTEP) as server:
        client = Client(14030 + 218, 14280 + 218)
        beats = [client.message("HEARTBEAT") for _ in range(3)]
        client.close()
        assert len(beats) == 3
        assert server.sim.t_s == 0.0


def test_streams_keep_their_rates_by_wall_time_while_the_clock_stands() -> None:
    clock, (ours, theirs) = ManualClock(), pair()
    server = Server(Simulation(forest()), [Link(OPERATOR, Connection(ours, 1, 1))], LOCKSTEP, clock)
    server.run(lambda: clock.now_s() >= 2.0)
    counts = Counter(m.get_type() for m in Connection(theirs, 245, 190).receive())
    assert server.sim.t_s == 0.0
    assert counts["ATTITUDE"] == pytest.approx(200, abs=2)
    assert counts["LOCAL_POSITION_NED"] == pytest.approx(100, abs=2)
