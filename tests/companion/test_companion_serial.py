"""Does a whole flight go over a serial line, with its plug pulled before it? A pseudo terminal, ten times as fast."""

import contextlib
import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pretend_vehicle import PretendVehicle

from companion.app import CompanionConfig, Summary, fly
from companion.app.signals import StopRequest
from companion.core import codec
from companion.core.mavlink import Connection
from companion.core.task import Task
from companion.core.transport import Selectable

TASK = Task(np.array([5.0, 1.0]), -3.0, 3.0)
PACE_S = 0.004
LOST_S = 1.5
PULLED_S = LOST_S + 0.5


class Master:
    """The vehicle's end of the line."""

    name = "master"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.put_in()

    def put_in(self) -> None:
        self._fd, self._slave = os.openpty()
        os.set_blocking(self._fd, False)
        self._path.unlink(missing_ok=True)
        self._path.symlink_to(os.ttyname(self._slave))

    def pull(self) -> None:
        self._path.unlink()
        os.close(self._slave)
        os.close(self._fd)

    def send(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):  # nobody reads: an autopilot's buffer runs over, too
            os.write(self._fd, data)

    def receive(self) -> list[bytes]:
        with contextlib.suppress(BlockingIOError):
            return [os.read(self._fd, 4096)]
        return []

    def files(self) -> Sequence[Selectable]:
        return ()

    def ready(self) -> bool:
        return False

    def close(self) -> None:
        self.pull()


def test_a_flight_over_a_serial_line_survives_a_plug_pulled_before_it(tmp_path: Path) -> None:
    master = Master(tmp_path / "ttyTELEM")
    vehicle = PretendVehicle(Connection(master, 1, 1))
    config = CompanionConfig(TASK, tmp_path / "log", f"serial://{tmp_path / 'ttyTELEM'}:921600", lost_timeout_s=LOST_S)
    said: list[str] = []
    ended: list[Summary] = []
    companion = threading.Thread(target=lambda: ended.append(fly(config, stop=StopRequest(), say=said.append)))
    companion.start()

    def live(until: int) -> None:
        while vehicle.k < until and not ended:
            vehicle.step()
            time.sleep(PACE_S)

    live(60)
    master.pull()
    time.sleep(PULLED_S)
    master.put_in()
    answered = len(vehicle.setpoints)
    live(400)
    assert len(vehicle.setpoints) > answered > 10
    vehicle.custom_mode = codec.PX4_OFFBOARD
    live(4000)
    companion.join(10.0)
    master.close()
    assert [(summary.exit_code, summary.reason) for summary in ended] == [(0, "landed and disarmed")]
    assert np.linalg.norm(vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5
    assert said[1:3] == [f"vehicle silent for {LOST_S:g} s: waiting for it", "vehicle is back"]
