"""The operator against the real vehicle: what it says when a step does not work out."""

import asyncio
import contextlib
import json
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from mission.operator import OperatorConfig, OperatorError, fly
from mission.processes import Children
from mission.world_file import load_world
from sitl.server import RunConfig
from sitl.vehicle_config import VehicleConfig

QUICK = RunConfig(speed=20.0, gates=True)


def operate(instance: int, said: list[str], **limits: Any) -> None:
    config = OperatorConfig(f"udpin://0.0.0.0:{14030 + instance}", time_limit_s=60.0, **limits)
    asyncio.run(fly(config, said.append))


def start_vehicle(children: Children, folder: Path, instance: int) -> None:
    config = VehicleConfig(load_world("open"), run=QUICK, instance=instance, log_dir=folder)
    (folder / "vehicle.json").write_text(json.dumps(config.to_json()))
    children.start("vehicle", "sitl", [str(folder / "vehicle.json")], folder / "vehicle.log")


def test_no_vehicle_is_said_with_address_and_patience(instance: int) -> None:
    began_s = time.monotonic()
    with pytest.raises(OperatorError, match=r"no vehicle answered on udpin://0.0.0.0:\d+ within 0.5 s"):
        operate(instance, [], connect_wall_s=0.5)
    assert time.monotonic() - began_s < 5.0


def test_without_a_companion_offboard_is_refused_and_the_vehicle_holds(tmp_path: Path, instance: int) -> None:
    said: list[str] = []
    with Children() as children:
        start_vehicle(children, tmp_path, instance)
        with pytest.raises(OperatorError, match="OFFBOARD refused, is the companion streaming"):
            operate(instance, said, offboard_wall_s=0.5)
    assert "in the air, holding" in said
    assert said[-1] == "vehicle: Switching to Offboard is currently not available"
    row = json.loads((tmp_path / "truth.jsonl").read_text().splitlines()[-1])
    assert (row["mode"], row["armed"], row["landed"]) == ("HOLD", True, "IN_AIR")


def test_a_vehicle_that_is_not_ready_in_time_is_said(tmp_path: Path, instance: int) -> None:
    with Children() as children:
        start_vehicle(children, tmp_path, instance)
        with pytest.raises(OperatorError, match="not ready to arm within 0 s"):
            operate(instance, [], ready_wall_s=0.0)


def test_the_operator_can_be_cancelled_from_the_first_moment_on(instance: int) -> None:
    async def cancelled() -> None:
        task = asyncio.create_task(fly(OperatorConfig(f"udpin://0.0.0.0:{14030 + instance}", 60.0), lambda _line: None))
        await asyncio.sleep(0.2)
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task

    asyncio.run(asyncio.wait_for(cancelled(), 5.0))
    assert threading.active_count() < 20
