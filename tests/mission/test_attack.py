"""Junk at every port, and somebody without the key: vehicle, companion and their flight do not care."""

import hashlib
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from companion.app.logs import record_line
from mission.attack import all_ports, attack, besieged, hostile, make_key, signed_ports
from mission.flight_plan import FlightPlan, plan_flight, plan_mission
from mission.hostile import junk
from mission.judge import Result
from mission.mission_file import load_mission
from mission.runner import FlySettings
from mission.simulate import fly_in_process
from sitl.truth_log import truth_sha256

OVER_WALL_S = 5.0
LOGS = ("companion.tlog", "vehicle_companion.tlog", "vehicle_gcs.tlog")
SPEED = 3.0  # slow enough for all of it to arrive while the flight lasts


@pytest.fixture(scope="module")
def short() -> FlightPlan:
    """The beginning of trajectory 1, obstacles included."""
    mission = load_mission("trajectory1")
    return plan_mission(mission.model_copy(update={"goal": (12.0, 0.0)}), seed=1)


@pytest.fixture(scope="module")
def undisturbed(short: FlightPlan) -> tuple[str, str]:
    """What the flight leaves behind when nobody disturbs it: record and truth."""
    twin = fly_in_process(short)
    record = b"".join(record_line(record.as_dict()) for record in twin.records)
    return hashlib.sha256(record).hexdigest(), truth_sha256(twin.sim.rows, twin.sim.spawn_ned_m)


def left_behind(result: Result) -> tuple[str, str]:
    return result.record_sha256, result.truth_sha256


@pytest.mark.parametrize("signed", [False, True], ids=["unsigned", "signed"])
def test_ten_thousand_packets_of_junk_at_every_port_do_not_change_a_flight(
    short: FlightPlan, undisturbed: tuple[str, str], tmp_path: Path, instance: int, signed: bool
) -> None:
    def source(port: int) -> Iterator[bytes]:
        return junk(random.Random(port))

    settings = FlySettings(SPEED, lockstep=True, instance=instance, sign_key=make_key(tmp_path) if signed else None)
    disturbed = besieged(short, settings, tmp_path / "flight", 10_000, source, all_ports(instance), OVER_WALL_S)
    assert set(disturbed.sent.values()) == {10_000}
    assert disturbed.result.landed, disturbed.result.reason
    assert left_behind(disturbed.result) == undisturbed
    for link, counts in disturbed.counts.items():
        assert counts["unknown"] > 500, link
        assert counts["bad_bytes"] > 100_000, link


def test_a_thousand_forged_and_replayed_packets_at_every_signed_port_do_not_change_a_flight(
    short: FlightPlan, undisturbed: tuple[str, str], tmp_path: Path, instance: int
) -> None:
    settings = FlySettings(SPEED, lockstep=True, instance=instance, sign_key=make_key(tmp_path))
    folder = tmp_path / "flight"
    source = hostile(1, [folder / log for log in LOGS])
    attacked = besieged(short, settings, folder, 1000, source, signed_ports(instance), OVER_WALL_S)
    assert set(attacked.sent.values()) == {1000}
    assert left_behind(attacked.result) == undisturbed
    for link in set(attacked.counts) - {"operator"}:
        counts = attacked.counts[link]
        assert counts["unsigned"] + counts["forged"] + counts["old"] > 950, link
        assert min(counts["unsigned"], counts["forged"], counts["old"]) > 50, link


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_whole_flight_under_attack_equals_the_one_without(seed: int, tmp_path: Path, instance: int) -> None:
    alone, attacked = attack(plan_flight("trajectory1", seed), instance, tmp_path, 1000)
    assert alone.success, alone.reason
    assert left_behind(attacked.result) == left_behind(alone)
