"""Does the process fly by a LiDAR of its own as by the vehicle's? In one thread, on a clock moved by hand."""

import math
from pathlib import Path

import numpy as np
import pytest
from companion_bench import TASK, Bench, HoldNavigator
from pretend_vehicle import STEP_S

from companion import navigator
from companion.app.logs import PACKETS, RECORDS, record_line
from companion.app.session import Session
from companion.core import codec
from companion.core.types import Scan
from companion.link.lidar_replay import ReplayLidar, write_scans
from companion.link.replay import replay

SCAN_HZ = 12.5


def recording(path: Path, seconds: float = 60.0) -> ReplayLidar:
    """An empty field, scanned for a while."""
    free = np.full(72, math.inf)
    times_s = np.arange(0.0, seconds, 1 / SCAN_HZ)
    write_scans(path, [Scan(float(t_s), free, 0.0, math.radians(5.0), 0.25, 12.0) for t_s in times_s])
    return ReplayLidar(path)


def test_scans_of_our_own_lidar_drive_the_ticks_and_the_vehicle_hears_them_too(tmp_path: Path) -> None:
    bench = Bench(tmp_path, local_lidar=recording(tmp_path / "scans.jsonl"))
    bench.vehicle.sends_scans = False
    bench.run(10.0)
    vehicle = bench.vehicle
    stamps_s = [setpoint.t_s for setpoint in vehicle.setpoints]
    assert stamps_s == pytest.approx(STEP_S + np.arange(len(stamps_s)) / SCAN_HZ)
    assert len(stamps_s) == round(10.0 * SCAN_HZ)
    assert [message.time_usec / 1e6 for message in vehicle.scans_heard] == stamps_s
    for message in vehicle.scans_heard:
        assert (message.get_srcSystem(), message.get_srcComponent(), message.frame) == (1, 191, 12)
        assert np.isinf(codec.decode_scan(message).range_m).all()


def test_it_flies_to_the_goal_by_its_own_lidar_and_a_replay_of_the_log_agrees(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator, local_lidar=recording(tmp_path / "scans.jsonl"))
    bench.vehicle.sends_scans = False
    bench.run(1.0)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(60.0)
    assert (bench.companion.exit_code, bench.companion.reason) == (0, "landed and disarmed")
    assert np.linalg.norm(bench.vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5
    bench.logs.close()
    session = Session(TASK, navigator.Params(), navigator)
    again = b"".join(record_line(session.tick(i).row) for i in replay(tmp_path / "log" / PACKETS))
    assert again == (tmp_path / "log" / RECORDS).read_bytes()


def test_what_the_autopilot_makes_of_the_scans_is_not_taken_for_one(tmp_path: Path) -> None:
    bench = Bench(tmp_path, local_lidar=recording(tmp_path / "scans.jsonl"))
    bench.run(4.0)  # the vehicle streams OBSTACLE_DISTANCE of its own, on every step
    assert len(bench.brain.ticks) == round(4.0 * SCAN_HZ)
    assert all(inputs.scan.range_max_m == 12.0 for inputs in bench.brain.ticks)
    bench.logs.close()
    assert len(list(replay(tmp_path / "log" / PACKETS))) == len(bench.brain.ticks)


def test_a_recording_that_ends_in_flight_is_a_lidar_that_fails(tmp_path: Path) -> None:
    lidar = recording(tmp_path / "scans.jsonl", seconds=3.0)
    bench = Bench(tmp_path, brain=HoldNavigator((100.0, 0.0, -3.0)), local_lidar=lidar)
    bench.vehicle.sends_scans = False
    bench.run(1.0)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(6.0)
    assert bench.vehicle.texts == ["swiftnav: scan lost, holding"]
    before_m = bench.vehicle.pos_ned_m
    bench.run(2.0)
    assert np.linalg.norm(bench.vehicle.pos_ned_m - before_m) < 1e-3


def test_before_the_vehicle_is_heard_nothing_is_played(tmp_path: Path) -> None:
    bench = Bench(tmp_path, local_lidar=recording(tmp_path / "scans.jsonl"))
    bench.vehicle.sends_anything = False
    bench.run(2.0)
    bench.vehicle.sends_anything = True
    bench.run(1.0)
    assert len(bench.brain.ticks) == math.ceil(1.0 * SCAN_HZ)
    assert bench.companion.dropped_scans == 0
