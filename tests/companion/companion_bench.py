"""Vehicle and companion in one thread, joined by an in-process link, on a clock moved by hand."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from pretend_vehicle import STEP_S, PretendVehicle

from companion.app.config import CompanionConfig, Engage
from companion.app.logs import FlightLogs
from companion.app.opening import LIDAR_LINK, VEHICLE_LINK, Opened, connect
from companion.app.process import Companion
from companion.app.signals import StopRequest
from companion.core.clock import ManualClock
from companion.core.inputs import Inputs
from companion.core.keyring import Keyring
from companion.core.lossy import Loss, LossyTransport
from companion.core.mavlink import Connection
from companion.core.signing import PX4_UNSIGNED
from companion.core.task import Task
from companion.core.transport import Transport, pair
from companion.core.types import Setpoint
from companion.link.lidar_replay import ReplayLidar
from companion.link.lidar_serial import SerialLidar

TASK = Task(np.array([8.0, 2.0]), -3.0, 3.0)


class HoldNavigator:
    """Asks for one place, for ever; raises or asks for nonsense where it is told to."""

    def __init__(self, place: tuple[float, float, float] = (5.0, 0.0, -3.0)) -> None:
        self.place = np.array(place)
        self.fail: Callable[[float], bool] = lambda _t_s: False
        self.ticks: list[Inputs] = []

    def start(self, _params: Any) -> int:
        return 0

    def tick(self, memory: int, inputs: Inputs, _task: Task, _params: Any) -> tuple[int, Setpoint, Any]:
        self.ticks.append(inputs)
        if self.fail(inputs.scan.t_s):
            raise ZeroDivisionError("a bug of ours")
        place = self.place if inputs.status.offboard else inputs.state.pos_ned_m
        row = {"t_s": inputs.scan.t_s, "mode": "travel" if inputs.status.offboard else "standby", "n": memory}
        return memory + 1, Setpoint(inputs.state.t_s, place, None, None, 0.0), SimpleNamespace(as_dict=lambda: row)


@dataclass
class Bench:
    """Vehicle and companion joined by an in-process link."""

    tmp_path: Path
    brain: Any = field(default_factory=HoldNavigator)
    engage: Engage = Engage.WAIT
    loss: Loss | None = None
    own_lidar: bool = False
    local_lidar: ReplayLidar | SerialLidar | None = None
    wire: tuple[Transport, Transport] | None = None  # the companion's end and the vehicle's; None: in this process
    lidar_wire: tuple[Transport, Transport] | None = None
    key: Path | None = None  # both sign with it

    def __post_init__(self) -> None:
        self.clock = ManualClock()
        self.stop = StopRequest()
        self.said: list[str] = []
        near, far = self.wire or pair("pair://vehicle")
        ends = [near]
        lidar = None
        rings = [Keyring(self.key, name, self.clock) if self.key else None for name in ("vehicle", "companion")]
        signing = [rings[0].link(i, PX4_UNSIGNED) if rings[0] else None for i in (VEHICLE_LINK, LIDAR_LINK)]
        if self.own_lidar:
            lidar_near, lidar_far = self.lidar_wire or pair("pair://lidar")
            ends.append(lidar_near)
            lidar = Connection(lidar_far, 1, 195, signing=signing[LIDAR_LINK])
        self.vehicle = PretendVehicle(Connection(far, 1, 1, signing=signing[VEHICLE_LINK]), lidar)
        config = CompanionConfig(TASK, self.tmp_path / "log", engage=self.engage, connect_timeout_s=5.0)
        self.logs = FlightLogs(config.log_dir)
        transports = ends if self.loss is None else [LossyTransport(end, self.loss, 3, self.clock) for end in ends]
        opened = Opened(transports[0], transports[1] if self.own_lidar else self.local_lidar, rings[1])
        links = connect(opened, config, self.logs, self.clock)
        self.companion = Companion(config, *links, self.logs, self.brain, self.clock)
        self.companion.say = self.said.append

    def run(self, duration_s: float) -> None:
        """Both sides, until then or until the companion ends."""
        for _ in range(round(duration_s / STEP_S)):
            if self.companion.exit_code is not None:
                return
            self.vehicle.step()
            self.clock.sleep_s(STEP_S)
            self.companion.turn(self.stop, wait_s=0.0)
        self.vehicle.listen()

    def rows(self, name: str) -> list[dict[str, Any]]:
        self.logs.flush()
        return [json.loads(line) for line in (self.tmp_path / "log" / name).read_text().splitlines()]
