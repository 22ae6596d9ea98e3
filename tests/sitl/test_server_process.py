"""The vehicle as a program of its own, flown by MAVSDK: real sockets, real time (a little faster)."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

from companion.core.tlog import read_tlog
from sitl.server import RunConfig
from sitl.simulation import SimConfig
from sitl.vehicle import Turbulence, Wind
from sitl.vehicle_config import ConfigError, VehicleConfig, from_json
from sitl.world import World

INSTANCE = 221


def config(log_dir: Path | None, speed: float = 5.0, instance: int = INSTANCE) -> VehicleConfig:
    world = World("empty", np.zeros(2), np.array([5.0, 0.0]), (-9, -9, 9, 9), np.zeros((0, 4)), np.zeros((0, 6)))
    sim = SimConfig(seed=2, spawn_ned_m=(1.0, 2.0), wind=Wind((1.0, 0.0, 0.0), Turbulence.LIGHT))
    return VehicleConfig(world, sim, RunConfig(speed=speed), instance=instance, log_dir=log_dir)


@contextmanager
def process(settings: VehicleConfig, folder: Path) -> Iterator[subprocess.Popen[str]]:
    path = folder / "vehicle.json"
    path.write_text(json.dumps(settings.to_json()), encoding="utf-8")
    child = subprocess.Popen([sys.executable, "-m", "sitl", str(path)], stderr=subprocess.PIPE, text=True)
    try:
        yield child
    finally:
        if child.poll() is None:
            child.kill()
        child.communicate()


def test_a_configuration_survives_json() -> None:
    for settings in (config(Path("logs")), config(None, float("inf"))):
        back = from_json(json.loads(json.dumps(settings.to_json())))
        assert (back.sim, back.run, back.instance, back.log_dir) == (
            settings.sim,
            settings.run,
            settings.instance,
            settings.log_dir,
        )


@pytest.mark.parametrize("broken", [{}, {"world": 3, "run": {}}, {"run": {"sped": 1}}])
def test_a_broken_configuration_is_one_clear_error(broken: dict[str, Any]) -> None:
    whole = config(None).to_json()
    with pytest.raises(ConfigError, match="vehicle configuration"):
        from_json({**whole, **broken} if broken else {})


def test_a_port_in_use_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("0.0.0.0", 14580 + INSTANCE + 1))
        logs = tmp_path / "logs"
        with process(config(logs, instance=INSTANCE + 1), tmp_path) as child:
            _, errors = child.communicate(timeout=60)
        assert child.returncode == 2
        assert errors.count("\n") == 1
        assert str(14580 + INSTANCE + 1) in errors
        assert not logs.exists(), "nothing half-written"


def test_a_log_folder_that_cannot_be_made_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with process(config(tmp_path / "file" / "logs"), tmp_path) as child:
        _, errors = child.communicate(timeout=60)
    assert child.returncode == 2
    assert errors.count("\n") == 1
    assert "cannot be written" in errors


def test_mavsdk_arms_takes_off_holds_and_lands(tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    with process(config(logs), tmp_path) as child:
        seen = asyncio.run(asyncio.wait_for(_fly(), 90.0))
        child.send_signal(signal.SIGTERM)
        _, errors = child.communicate(timeout=10)
        assert child.returncode == 0, errors
    assert seen["altitude_m"] == pytest.approx(3.0, abs=0.3)
    assert [m for m in seen["landed"] if m != "UNKNOWN"] == [
        "ON_GROUND",
        "TAKING_OFF",
        "IN_AIR",
        "LANDING",
        "ON_GROUND",
    ]
    assert seen["refused"], "arming before the vehicle is ready"
    rows = [json.loads(line) for line in (logs / "truth.jsonl").read_text().splitlines()]
    assert rows[0]["pos_world_ned_m"][:2] == pytest.approx([1.0, 2.0], abs=1e-3)
    assert max(-row["pos_world_ned_m"][2] for row in rows) == pytest.approx(3.0, abs=0.3)
    assert json.loads((logs / "sitl.json").read_text())["config"]["sim"]["seed"] == 2
    assert sum(1 for _ in read_tlog(logs / "vehicle_companion.tlog")) > 100


async def _fly() -> dict[str, Any]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        await mavsdk.add_any_connection(f"udpin://0.0.0.0:{14540 + INSTANCE}")
        system = await mavsdk.first_autopilot(30.0)
        assert system is not None
        return await _mission(system)
    finally:
        mavsdk.destroy()


async def _mission(system: System) -> dict[str, Any]:
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    seen: dict[str, Any] = {"landed": [], "refused": False}
    watch = asyncio.create_task(_collect(telemetry.subscribe_landed_state(), seen["landed"]))
    try:
        await action.arm()
    except ActionError:
        seen["refused"] = True
    await _until(telemetry.subscribe_health_all_ok(), lambda ok: ok)
    await _until(telemetry.subscribe_health(), lambda health: health.is_armable)
    await action.set_takeoff_altitude(3.0)
    await action.arm()
    await action.takeoff()
    await _until(telemetry.subscribe_flight_mode(), lambda mode: mode.name == "HOLD")
    await action.hold()
    await asyncio.sleep(0.5)
    position = await anext(telemetry.subscribe_position())
    seen["altitude_m"] = position.relative_altitude_m
    await action.land()
    await _until(telemetry.subscribe_armed(), lambda armed: not armed)
    await asyncio.sleep(0.1)
    watch.cancel()
    return seen


async def _collect(stream: AsyncIterator[Any], names: list[str]) -> None:
    async for value in stream:
        if not names or names[-1] != value.name:
            names.append(value.name)


async def _until(stream: AsyncIterator[Any], reached: Callable[[Any], bool]) -> None:
    deadline_s = time.monotonic() + 30.0
    async for value in stream:
        if reached(value):
            return
        assert time.monotonic() < deadline_s, value
