"""Whole flights with real processes and sockets, and every way in which one can end early."""

import hashlib
import json
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common as mavlink

from companion.app.logs import record_line
from companion.core.tlog import read_tlog
from mission import runner
from mission.console import FlightConsole, LogTail
from mission.flight_plan import FlightPlan, plan_flight
from mission.judge import Result
from mission.processes import Child, Children
from mission.runner import FlySettings, companion_arguments
from mission.simulate import fly_in_process
from sitl.truth_log import truth_sha256


class Trigger(FlightConsole):
    """Does something once when the navigator is on its way."""

    def __init__(self, folder: Path, act: Callable[[], None]) -> None:
        super().__init__("test", LogTail(folder / "navigator.jsonl"), quiet=True)
        self._watched = LogTail(folder / "navigator.jsonl")
        self._act: Callable[[], None] | None = act

    def refresh(self) -> None:
        row = self._watched.read()
        if self._act is not None and row is not None and row["mode"] != "standby" and row["goal_distance_m"] < 45.0:
            act, self._act = self._act, None
            act()


class Recorded(Children):
    """Remembers what was started."""

    started: dict[str, Child] = {}  # noqa: RUF012

    def start(self, name: str, *rest: Any) -> Child:
        child = super().start(name, *rest)
        self.started[name] = child
        return child


def fly(plan: FlightPlan, folder: Path, instance: int, act: Callable[[], None] = lambda: None) -> Result:
    with Trigger(folder, act) as console:
        return runner.fly(plan, FlySettings(instance=instance), folder, console)


def last_truth(folder: Path) -> dict[str, Any]:
    row: dict[str, Any] = json.loads((folder / "truth.jsonl").read_text().splitlines()[-1])
    return row


def test_a_flight_over_mavlink_succeeds_and_equals_its_twin_in_process(tmp_path: Path, instance: int) -> None:
    plan = plan_flight("trajectory1", seed=1)
    result = fly(plan, tmp_path, instance)
    assert result.success, result.reason
    twin = fly_in_process(plan)
    record = b"".join(record_line(record.as_dict()) for record in twin.records)
    assert result.record_sha256 == hashlib.sha256(record).hexdigest()
    assert result.truth_sha256 == truth_sha256(twin.sim.rows, twin.sim.spawn_ned_m)
    for name in ("mission.yaml", "world.yaml", "params.yaml", "versions.json", "top_view.png", "strips.png"):
        assert (tmp_path / name).stat().st_size > 100
    assert json.loads((tmp_path / "result.json").read_text()) == json.loads(json.dumps(result.as_dict()))
    for name in ("companion", "vehicle_companion", "vehicle_operator", "vehicle_gcs"):
        assert sum(1 for _ in read_tlog(tmp_path / f"{name}.tlog")) > 10


def test_ctrl_c_leaves_a_vehicle_that_holds_and_closed_logs(
    tmp_path: Path, instance: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "Children", Recorded)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job is born deaf to it
    with pytest.raises(KeyboardInterrupt):
        fly(plan_flight("trajectory1", seed=2), tmp_path, instance, lambda: os.kill(os.getpid(), signal.SIGINT))
    assert {child.exit_code for child in Recorded.started.values()} == {0, 130}
    assert (last_truth(tmp_path)["mode"], last_truth(tmp_path)["armed"]) == ("HOLD", True)
    assert json.loads((tmp_path / "result.json").read_text())["reason"] == "interrupted"
    assert (tmp_path / "navigator.jsonl").read_bytes().endswith(b"}\n")
    assert "end" in (tmp_path / "companion.jsonl").read_text().splitlines()[-1]


@pytest.mark.parametrize("victim", ["companion", "vehicle"])
def test_a_process_that_dies_ends_the_flight_with_its_name(
    victim: str, tmp_path: Path, instance: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "Children", Recorded)

    def kill() -> None:
        Recorded.started[victim].process.kill()

    result = fly(plan_flight("trajectory1", seed=3), tmp_path, instance, kill)
    assert not result.success
    assert result.reason == f"the {victim} ended: signal 9"
    assert all(child.exit_code is not None for child in Recorded.started.values())


def test_the_time_limit_counts_vehicle_time_and_ends_in_hold(tmp_path: Path, instance: int) -> None:
    plan = plan_flight("trajectory1", seed=4)
    success = plan.mission.success.model_copy(update={"time_limit_s": 5.0})
    hurried = plan.mission.model_copy(update={"success": success})
    short = FlightPlan(hurried, plan.world, plan.params, plan.seed, plan.draws, plan.task)
    result = fly(short, tmp_path, instance)
    assert (result.success, result.reason) == (False, "time limit of 5 s reached")
    assert last_truth(tmp_path)["mode"] == "HOLD"


def test_the_companion_is_told_exactly_the_goal_of_the_plan(tmp_path: Path) -> None:
    for seed in range(10):
        plan = plan_flight("trajectory2", seed)
        words = companion_arguments(plan, FlySettings(), tmp_path)
        goal = words[words.index("--goal") + 1 : words.index("--cruise")]
        assert [float(word) for word in goal] == plan.task.goal_ned_m.tolist()


def test_a_pilot_who_takes_the_mode_has_the_vehicle(tmp_path: Path, instance: int) -> None:
    def flip() -> None:
        """From the ground station's link."""
        station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        hold = station.command_long_encode(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, 4, 3, 0, 0, 0, 0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.sendto(hold.pack(station), ("127.0.0.1", 18570 + instance))

    result = fly(plan_flight("trajectory1", seed=5), tmp_path, instance, flip)
    assert (result.success, result.reason) == (False, "the vehicle left OFFBOARD for HOLD")
