"""Does the process keep its promises, in good flights and bad? In one thread, on a clock moved by hand."""

import itertools
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from companion_bench import TASK, Bench, HoldNavigator
from pretend_vehicle import STEP_S

from companion import navigator
from companion.app.config import Engage
from companion.app.logs import EVENTS, PACKETS, RECORDS, TIMINGS, record_line
from companion.app.session import Session
from companion.core import codec
from companion.core.lossy import Loss
from companion.core.types import LandedState
from companion.link.replay import replay


def test_before_offboard_every_scan_is_answered_with_where_the_vehicle_is(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator)
    bench.run(2.0)
    vehicle = bench.vehicle
    assert [sp.t_s for sp in vehicle.setpoints] == [round(k * STEP_S, 6) for k in range(1, vehicle.k + 1)]
    for setpoint in vehicle.setpoints:
        np.testing.assert_array_equal(setpoint.pos_ned_m, vehicle.pos_ned_m)
        assert (setpoint.vel_ned_m_s, setpoint.acc_ned_m_s2, setpoint.yaw_rad) == (None, None, 0.0)
    assert vehicle.mode_requests == []
    assert bench.said == ["vehicle 1 heard on pair://vehicle"]


def test_the_navigator_flies_to_the_goal_lands_and_the_run_is_over(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator)
    bench.run(1.0)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(60.0)
    assert (bench.companion.exit_code, bench.companion.reason) == (0, "landed and disarmed")
    assert np.linalg.norm(bench.vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5
    rows = bench.rows(RECORDS)
    assert {"standby", "travel", "landing"} <= {row["mode"] for row in rows}
    assert [row["t_s"] for row in rows] == [round(k * STEP_S, 6) for k in range(1, bench.vehicle.k + 1)]
    assert len(bench.rows(TIMINGS)) == len(rows)
    assert bench.rows(TIMINGS)[0].keys() == {"t_s", "wall_s", "tick_ms", "loop_ms", "decision"}
    assert rows[-1]["mode"] == "standby"  # the scan that found it disarmed was answered, and no further one


def test_a_replay_of_the_log_gives_the_same_records_byte_for_byte(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator)
    bench.run(0.4)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(60.0)
    bench.logs.close()
    session = Session(TASK, navigator.Params(), navigator)
    again = b"".join(record_line(session.tick(i).row) for i in replay(tmp_path / "log" / PACKETS))
    assert again == (tmp_path / "log" / RECORDS).read_bytes()
    assert bench.logs.ticks > 100


def test_the_companion_introduces_itself_once_a_second_and_is_no_vehicle(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.run(10.0)
    assert len(bench.vehicle.heartbeats) in (10, 11, 12)
    for heartbeat in bench.vehicle.heartbeats:
        assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (1, 191)
        assert (heartbeat.type, heartbeat.autopilot, heartbeat.base_mode) == (18, 8, 0)


def test_a_vehicle_with_another_system_id_is_spoken_to_by_its_id(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.vehicle.link.speak_as(3, 1)
    bench.run(2.5)
    assert bench.vehicle.setpoints
    assert bench.vehicle.heartbeats[-1].get_srcSystem() == 3


def test_no_vehicle_within_the_time_given_is_one_line(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.vehicle.sends_anything = False
    bench.run(6.0)
    assert bench.companion.exit_code == 3
    assert bench.said == ["no vehicle answered on udpin://127.0.0.1:14540 within 5 s"]


def test_a_vehicle_that_falls_silent_in_flight_ends_the_run(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(1.0)
    bench.vehicle.sends_anything = False
    bench.run(2.9)
    assert bench.companion.exit_code is None
    bench.run(0.3)
    assert bench.companion.exit_code == 4
    assert bench.said[-1] == "vehicle lost: nothing heard for 3 s"


def test_a_vehicle_that_falls_silent_while_nobody_steers_is_waited_for(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.run(1.0)
    bench.vehicle.sends_anything = False
    bench.run(7.0)
    assert bench.said[-1] == "vehicle silent for 3 s: waiting for it"
    bench.vehicle.sends_anything = True
    bench.run(1.0)
    assert "vehicle is back" in bench.said
    assert bench.vehicle.setpoints[-1].t_s == bench.vehicle.t_s
    bench.vehicle.sends_anything = False
    bench.run(8.5)
    assert (bench.companion.exit_code, bench.said[-1]) == (3, "vehicle did not come back within 5 s")


@pytest.mark.parametrize("silent_s", [0.5, 5.0])
def test_a_vehicle_that_boots_is_flown_to_the_goal_counted_from_where_it_booted(
    tmp_path: Path, silent_s: float
) -> None:
    bench = Bench(tmp_path, brain=navigator)
    vehicle = bench.vehicle
    bench.run(10.0)
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(1.5)
    vehicle.custom_mode = codec.PX4_HOLD  # the pilot lands it, and pulls the battery
    bench.run(0.5)
    vehicle.sends_anything = False
    bench.run(silent_s)
    assert np.linalg.norm(vehicle.pos_ned_m[:2]) > 1.0
    vehicle.k, vehicle.pos_ned_m, vehicle.sends_anything = 0, np.array([0.0, 0.0, -3.0]), True
    bench.run(2.0)
    assert "vehicle has booted: starting afresh, with the goal counted from where it is now" in bench.said
    assert vehicle.mode_requests == []
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(60.0)
    assert (bench.companion.exit_code, bench.companion.reason) == (0, "landed and disarmed")
    assert np.linalg.norm(vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5
    bench.logs.close()
    session = Session(TASK, navigator.Params(), navigator)
    again = b"".join(record_line(session.tick(i).row) for i in replay(tmp_path / "log" / PACKETS))
    assert again == (tmp_path / "log" / RECORDS).read_bytes()


def test_a_vehicle_that_boots_in_flight_is_not_taken_for_one_that_has_landed(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator)
    bench.run(10.0)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(1.0)
    bench.vehicle.k, bench.vehicle.armed, bench.vehicle.custom_mode = 0, False, codec.PX4_HOLD
    bench.run(3.0)
    assert bench.companion.exit_code is None


def test_a_vehicle_clock_that_stands_still_while_it_speaks_is_not_lost(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.run(1.0)
    for _ in range(200):
        bench.vehicle.link.send(codec.encode_vehicle_heartbeat(157, codec.PX4_HOLD, 4))
        bench.clock.sleep_s(0.1)
        bench.companion.turn(bench.stop, wait_s=0.0)
    assert bench.companion.exit_code is None


def test_a_scan_that_stops_in_flight_brakes_holds_says_so_and_goes_on_when_it_is_back(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=HoldNavigator((100.0, 0.0, -3.0)))
    vehicle = bench.vehicle
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(2.0)
    vehicle.sends_scans = False
    bench.run(0.6)
    assert vehicle.texts == ["swiftnav: scan lost, holding"]
    before = len(vehicle.setpoints)
    ticks = bench.logs.ticks
    bench.run(2.0)
    held = vehicle.setpoints[before:]
    assert len(held) >= 20
    assert max(b.t_s - a.t_s for a, b in itertools.pairwise(held)) <= 0.1
    places = np.array([sp.pos_ned_m for sp in held])
    assert np.ptp(places, axis=0).max() < 1e-6  # one place, near where the vehicle was then
    assert np.linalg.norm(places[0] - vehicle.pos_ned_m) < 1e-3
    assert bench.logs.ticks == ticks
    vehicle.sends_scans = True
    bench.run(1.0)
    assert vehicle.setpoints[-1].pos_ned_m[0] == 100.0
    assert vehicle.texts[-1] == "swiftnav: scan is back, going on"
    assert len(vehicle.texts) == 2
    assert {"scan lost, holding", "scan is back, going on"} <= {row.get("text") for row in bench.rows(EVENTS)}


def test_without_scans_on_the_ground_nothing_is_streamed_and_the_user_is_told_once(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.vehicle.sends_scans = False
    bench.run(20.0)
    assert bench.vehicle.setpoints == []
    assert [text for text in bench.said if "no scan" in text] == [
        "no scan for 5 s: is the LiDAR running, and on the vehicle's clock?"
    ]


def test_a_vehicle_disarmed_while_the_scan_is_lost_ends_the_run(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(1.0)
    bench.vehicle.sends_scans = False
    bench.run(1.0)
    bench.vehicle.armed = False
    bench.run(1.0)
    assert bench.companion.exit_code == 0


@pytest.mark.parametrize("nonsense", ["raises", "nan"])
def test_a_tick_that_fails_in_flight_ends_in_a_hold_until_the_pilot_takes_over(tmp_path: Path, nonsense: str) -> None:
    bench = Bench(tmp_path, brain=HoldNavigator((100.0, 0.0, -3.0)))
    vehicle, brain = bench.vehicle, bench.brain
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(2.0)
    if nonsense == "raises":
        brain.fail = lambda _t_s: True
    else:
        brain.place = np.array([np.nan, 0.0, -3.0])
    bench.run(STEP_S * 2)
    place, count, ticks = vehicle.pos_ned_m, len(vehicle.setpoints), len(brain.ticks)
    bench.run(3.0)
    assert vehicle.texts == ["swiftnav: navigator failed, holding"]
    assert len(vehicle.setpoints) - count >= 74  # every scan is answered still
    assert np.linalg.norm(vehicle.pos_ned_m - place) < 0.2
    assert len(brain.ticks) == ticks  # a navigator that failed is not asked again
    failed = next(row for row in bench.rows(EVENTS) if row["event"] == "navigator failed")
    assert ("ZeroDivisionError" if nonsense == "raises" else "ValueError") in failed["exception"]
    vehicle.custom_mode = 196608  # POSCTL: the pilot
    bench.run(0.2)
    assert bench.companion.exit_code == 5


def test_a_tick_that_fails_on_the_ground_ends_the_run_at_once(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.brain.fail = lambda _t_s: True
    bench.run(1.0)
    assert bench.companion.exit_code == 5
    assert bench.said[-1] == "navigator failed before the flight: ZeroDivisionError: a bug of ours"
    assert bench.vehicle.setpoints == []


@pytest.mark.parametrize(("signal_number", "exit_code"), [(2, 130), (15, 143)])
def test_asked_to_stop_in_flight_it_holds_and_hands_the_vehicle_back(
    tmp_path: Path, signal_number: int, exit_code: int
) -> None:
    bench = Bench(tmp_path, brain=HoldNavigator((100.0, 0.0, -3.0)))
    vehicle = bench.vehicle
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(2.0)
    bench.stop.set(signal_number)
    bench.run(1.0)
    assert (bench.companion.exit_code, bench.companion.reason) == (exit_code, "stopped, the autopilot holds")
    assert vehicle.custom_mode == codec.PX4_HOLD
    assert "swiftnav: stopping, holding" in vehicle.texts


def test_an_autopilot_that_does_not_take_over_is_held_for_two_seconds_then_left(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=HoldNavigator((100.0, 0.0, -3.0)))
    vehicle = bench.vehicle
    vehicle.obeys_modes = False
    vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(2.0)
    bench.stop.set(2)
    count = len(vehicle.setpoints)
    bench.run(1.9)
    assert bench.companion.exit_code is None
    assert len(vehicle.setpoints) - count >= 45
    assert vehicle.setpoints[-1].pos_ned_m[0] < 50.0
    bench.run(0.4)
    assert bench.companion.exit_code == 130
    assert vehicle.mode_requests == [codec.PX4_HOLD, codec.PX4_HOLD]


def test_asked_to_stop_on_the_ground_it_stops(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.run(1.0)
    bench.stop.set(15)
    bench.run(0.1)
    assert (bench.companion.exit_code, bench.companion.reason) == (143, "stopped")
    assert bench.vehicle.mode_requests == []


def test_told_to_engage_it_asks_for_offboard_from_a_hold_in_the_air(tmp_path: Path) -> None:
    bench = Bench(tmp_path, engage=Engage.AUTO)
    vehicle = bench.vehicle
    vehicle.landed, vehicle.armed = LandedState.ON_GROUND, False
    bench.run(2.0)
    vehicle.armed = True
    bench.run(2.0)
    vehicle.landed, vehicle.custom_mode = LandedState.TAKEOFF, 33816576  # AUTO.TAKEOFF
    bench.run(2.0)
    vehicle.landed, vehicle.custom_mode = LandedState.IN_AIR, 196608  # the pilot flies POSCTL
    bench.run(2.0)
    assert vehicle.mode_requests == []
    vehicle.custom_mode = codec.PX4_HOLD
    bench.run(1.0)
    assert vehicle.mode_requests == [codec.PX4_OFFBOARD]
    assert vehicle.offboard


def test_a_refused_offboard_is_asked_for_again_once_a_second(tmp_path: Path) -> None:
    bench = Bench(tmp_path, engage=Engage.AUTO)
    bench.vehicle.obeys_modes = False
    bench.run(5.5)
    assert 5 <= len(bench.vehicle.mode_requests) <= 6


def test_a_pilot_who_takes_the_vehicle_back_keeps_it(tmp_path: Path) -> None:
    bench = Bench(tmp_path, engage=Engage.AUTO)
    bench.run(2.0)
    assert bench.vehicle.offboard
    bench.vehicle.custom_mode = codec.PX4_HOLD
    bench.run(5.0)
    assert bench.vehicle.mode_requests == [codec.PX4_OFFBOARD]
    np.testing.assert_array_equal(bench.vehicle.setpoints[-1].pos_ned_m, bench.vehicle.pos_ned_m)


def test_a_lidar_on_its_own_connection_makes_the_same_flight(tmp_path: Path) -> None:
    records = []
    for own_lidar in (False, True):
        bench = Bench(tmp_path / str(own_lidar), brain=navigator, own_lidar=own_lidar)
        bench.vehicle.custom_mode = codec.PX4_OFFBOARD
        bench.run(60.0)
        assert bench.companion.exit_code == 0
        bench.logs.close()
        records.append((tmp_path / str(own_lidar) / "log" / RECORDS).read_bytes())
    assert records[0] == records[1]


def test_a_bad_radio_does_not_keep_it_from_landing(tmp_path: Path) -> None:
    loss = Loss(loss=0.1, duplicate=0.05, delay_s=0.01, jitter_s=0.05)
    bench = Bench(tmp_path, brain=navigator, loss=loss)
    bench.run(2.0)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(90.0)
    assert bench.companion.exit_code == 0
    assert np.linalg.norm(bench.vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5


def test_garbage_on_the_link_costs_nothing(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    rng = np.random.default_rng(1)
    for _ in range(50):
        bench.vehicle.link.transport.send(rng.integers(0, 256, int(rng.integers(1, 80))).astype(np.uint8).tobytes())
        bench.vehicle.link.transport.send(b"\xfd\xff\x00")
        bench.run(STEP_S)
    assert len(bench.brain.ticks) == 50


def test_a_status_line_comes_five_times_a_second_and_reads_well(tmp_path: Path) -> None:
    bench = Bench(tmp_path, brain=navigator)
    lines: list[Any] = []
    bench.companion.on_status = lines.append
    bench.run(4.0)
    assert 14 <= len(lines) <= 21
    assert lines[-1].mode == "standby"
    assert "standby" in str(lines[-1])
    assert "goal  8.25 m" in str(lines[-1])


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")  # noqa: PTH110
def test_a_disk_that_fills_up_ends_the_logs_and_not_the_flight(tmp_path: Path) -> None:
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / RECORDS).symlink_to("/dev/full")
    bench = Bench(tmp_path)
    bench.run(5.0)
    assert len(bench.vehicle.setpoints) == bench.vehicle.k
    bench.logs.close()
    assert bench.logs.problem is not None
    assert "No space left" in bench.logs.problem


def test_one_who_falls_behind_answers_the_newest_scan_only(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.run(1.0)
    answered = len(bench.brain.ticks)
    for _ in range(10):  # the vehicle flies on while the companion is busy elsewhere
        bench.vehicle.step()
    scans = bench.vehicle.t_s
    bench.companion.turn(bench.stop, 0.0)
    assert len(bench.brain.ticks) == answered + 1
    assert bench.companion.skipped_scans > 0
    assert scans - bench.brain.ticks[-1].scan.t_s < 0.1
