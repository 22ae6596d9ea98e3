"""Does the check before a flight pass the simulated vehicle, over UDP, and only what really is there?"""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from companion.app import CompanionConfig, preflight
from companion.app.preflight import Grade, Row
from companion.core.task import Task
from mission.cli import main
from mission.processes import Children
from mission.world_file import load_world
from sitl.server import RunConfig
from sitl.vehicle_config import VehicleConfig

LISTEN_S = 2.0
START_S = 30.0
SLOW_MACHINE = {"navigator", "vehicle's clock"}  # may be found wanting where many tests run at once
TASK = Task(np.array([50.0, 0.0]), -3.0, 3.0)


@contextmanager
def vehicle(folder: Path, instance: int, speed: float = 1.0) -> Iterator[None]:
    """On the ground in trajectory1, as ``swiftnav sitl`` starts it."""
    run = RunConfig(speed=speed, lockstep=False, gates=False)
    config = VehicleConfig(load_world("trajectory1"), run=run, instance=instance)
    (folder / "vehicle.json").write_text(json.dumps(config.to_json()))
    with Children() as children:
        child = children.start("vehicle", "sitl", [str(folder / "vehicle.json")], folder / "vehicle.log")
        deadline_s = time.monotonic() + START_S
        while not child.last_line().startswith("vehicle ") and time.monotonic() < deadline_s:
            time.sleep(0.02)
        yield


def checked(folder: Path, instance: int, lidar_url: str | None = None) -> dict[str, Row]:
    config = CompanionConfig(TASK, folder / "log", f"udpin://127.0.0.1:{14540 + instance}", lidar_url)
    return {row.name: row for row in preflight.check(config, LISTEN_S).rows}


def test_the_simulated_vehicle_is_fit_and_a_missing_lidar_is_found(
    tmp_path: Path, instance: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with vehicle(tmp_path, instance):
        arguments = ["companion", "--check", "--check-time", str(LISTEN_S), "--instance", str(instance)]
        code = main([*arguments, "--mission", "trajectory1", "--json"])
        told = json.loads(capsys.readouterr().out)
        assert code == (0 if told["fit"] else 6)
        grades = {row["name"]: row["grade"] for row in told["rows"]}
        bad = {name for name, grade in grades.items() if grade in ("fail", "warning")}
        assert bad <= SLOW_MACHINE
        assert {"vehicle", "vehicle link", "attitude", "position", "scan", "view", "goal", "navigator"} <= grades.keys()
        deaf = checked(tmp_path, instance, f"udpin://127.0.0.1:{14640 + instance}")
        assert deaf["scan"].grade is Grade.FAIL  # it has a link of its own, on which nobody speaks
    assert not (tmp_path / "log").exists()


def test_a_vehicle_that_lives_five_times_as_fast_is_told_and_one_that_is_gone_is_unfit(
    tmp_path: Path, instance: int
) -> None:
    with vehicle(tmp_path, instance, speed=5.0):
        rows = checked(tmp_path, instance)
        assert (rows["vehicle's clock"].grade, rows["vehicle's clock"].found[:2]) == (Grade.WARN, "5.")
    assert checked(tmp_path, instance)["vehicle"].grade is Grade.FAIL
