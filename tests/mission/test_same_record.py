"""One navigator, three ways to run it: in one process, over UDP in lockstep, replayed from the log; equal bytes."""

import hashlib
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from companion import navigator
from companion.app.logs import PACKETS, RECORDS, record_line
from companion.core.mavlink import PacketParser
from companion.core.tlog import read_tlog
from companion.link.replay import replay
from mission import runner
from mission.console import FlightConsole, LogTail
from mission.flight_plan import FlightPlan, plan_flight, plan_mission
from mission.judge import Result
from mission.mission_file import load_mission
from mission.runner import FlySettings
from mission.simulate import fly_in_process
from sitl.truth_log import truth_line

SLOW_FLIGHTS = [("trajectory1", 11), ("trajectory2", 1), ("trajectory2", 7), ("trajectory1_movers", 3), ("forest", 7)]


SCAN_MS = 40


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "_draw", lambda *_: None)


def short_plan(seed: int) -> FlightPlan:
    """The first third of trajectory 1, round its first trunks; landing included."""
    return plan_mission(load_mission("trajectory1").model_copy(update={"goal": (20.0, 0.0)}), seed)


def fly_over_udp(plan: FlightPlan, folder: Path, instance: int) -> Result:
    """The real processes over real sockets, in lockstep."""
    folder.mkdir()
    with FlightConsole("test", LogTail(folder / RECORDS), quiet=True) as console:
        return runner.fly(plan, FlySettings(instance=instance), folder, console)


def replayed(plan: FlightPlan, folder: Path) -> bytes:
    """The records once more, from nothing but the packets that the companion logged."""
    memory, lines = navigator.start(plan.params), []
    for inputs in replay(folder / PACKETS, plan.params.link):
        memory, _, record = navigator.tick(memory, inputs, plan.task, plan.params)
        lines.append(record_line(record.as_dict()))
    return b"".join(lines)


def in_process(plan: FlightPlan) -> tuple[bytes, bytes]:
    """Records and truth of the twin without sockets."""
    lines: list[bytes] = []
    sim = fly_in_process(plan, lambda record: lines.append(record_line(record.as_dict()))).sim
    truth = "".join(truth_line(row, sim.spawn_ned_m) + "\n" for row in sim.rows)
    return b"".join(lines), truth.encode()


def assert_equal_lines(some: bytes, others: bytes) -> None:
    """Names the first line that differs; the bytes themselves are megabytes."""
    for k, (one, other) in enumerate(zip(some.splitlines(), others.splitlines(), strict=False)):
        assert one == other, f"line {k}"
    assert len(some) == len(others)


def assert_scans_wait_for_answers(tlog: Path) -> None:
    """In lockstep no scan leaves before the one before it was answered, the last of the flight included."""
    parser, answered_ms, sent_ms = PacketParser(), 0, []
    for _, packet in read_tlog(tlog):
        for message in parser.feed(packet):
            if message.get_msgId() == mav.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
                answered_ms = message.time_boot_ms
            elif message.get_msgId() == mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
                assert not sent_ms or answered_ms == sent_ms[-1]
                sent_ms.append(message.time_usec // 1000)
    assert sent_ms == list(range(sent_ms[0], sent_ms[-1] + 1, SCAN_MS))


def assert_all_ways_agree(plan: FlightPlan, folder: Path, instance: int) -> Result:
    result = fly_over_udp(plan, folder, instance)
    flown, truth = (folder / RECORDS).read_bytes(), (folder / "truth.jsonl").read_bytes()
    assert result.landed, result.reason
    assert result.record_sha256 == hashlib.sha256(flown).hexdigest()
    assert result.truth_sha256 == hashlib.sha256(truth).hexdigest()
    assert_scans_wait_for_answers(folder / "vehicle_companion.tlog")
    assert_equal_lines(replayed(plan, folder), flown)
    twin_records, twin_truth = in_process(plan)
    assert_equal_lines(twin_records, flown)
    assert_equal_lines(twin_truth, truth)
    return result


def test_in_process_over_udp_and_replayed_are_one_record_and_a_second_flight_is_the_same(
    tmp_path: Path, instance: int
) -> None:
    first = assert_all_ways_agree(short_plan(11), tmp_path / "first", instance)
    second = fly_over_udp(short_plan(11), tmp_path / "second", instance)
    assert (second.record_sha256, second.truth_sha256) == (first.record_sha256, first.truth_sha256)
    assert first.rl_decisions > 5


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("mission", "seed"), SLOW_FLIGHTS)
def test_all_ways_agree_in_every_kind_of_world(mission: str, seed: int, tmp_path: Path, instance: int) -> None:
    first = assert_all_ways_agree(plan_flight(mission, seed), tmp_path / "first", instance)
    second = fly_over_udp(plan_flight(mission, seed), tmp_path / "second", instance)
    assert (second.record_sha256, second.truth_sha256) == (first.record_sha256, first.truth_sha256)


def test_another_seed_is_another_flight() -> None:
    draws = [plan_flight("trajectory1", seed).draws for seed in (11, 12)]
    assert draws[0] != draws[1]
