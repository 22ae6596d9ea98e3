"""A vehicle on its ports, served by a thread, and a pymavlink client that waits for what it wants to see."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.clock import SystemClock
from companion.core.mavlink import Connection
from companion.core.udp import Udp
from sitl.link import bind, open_links
from sitl.modes import FlightMode
from sitl.server import RunConfig, Server
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import TruthFile
from sitl.world import World


def forest() -> World:
    rng = np.random.default_rng(1)
    places = rng.uniform((4, -20), (40, 20), (40, 2))
    rows = np.column_stack([places, np.full(40, 0.3), np.full(40, math.inf)])
    rows = rows[np.abs(rows[:, 1]) > 1.5]
    return World("forest", np.zeros(2), np.array([30.0, 0.0]), (-50, -50, 50, 50), rows, np.zeros((0, 6)))


@contextmanager
def vehicle(instance: int, run: RunConfig, log_dir: Path | None = None, seed: int = 5) -> Iterator[Server]:
    """A vehicle on its ports, served by a thread."""
    clock = SystemClock()
    sim = Simulation(forest(), SimConfig(seed=seed))
    links = open_links(bind(instance, clock), 1, log_dir, clock)
    truth = TruthFile(log_dir / "truth.jsonl", sim.spawn_ned_m) if log_dir is not None else None
    server = Server(sim, links, run, clock, truth=truth)
    stop = threading.Event()
    thread = threading.Thread(target=server.run, args=(stop.is_set,))
    thread.start()
    try:
        yield server
    finally:
        stop.set()
        thread.join()
        for link in links:
            link.close()
        if truth is not None:
            truth.close()


class Client:
    """A pymavlink client that waits for what it wants to see."""

    def __init__(self, local_port: int, vehicle_port: int, system: int = 245, component: int = 190) -> None:
        self.seen: list[Any] = []
        self._connection = Connection(
            Udp("client", ("127.0.0.1", local_port), ("127.0.0.1", vehicle_port)), system, component
        )
        self._beat_s = 0.0
        self._kind = 18 if component == 191 else 6

    def send(self, *messages: Any) -> None:
        self._connection.send(*messages)

    def poll(self, timeout_s: float = 0.02) -> list[Any]:
        if time.monotonic() - self._beat_s > 0.5:
            self._beat_s = time.monotonic()
            self.send(mav.MAVLink_heartbeat_message(self._kind, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))
        new = self._connection.receive(timeout_s)
        self.seen += new
        return new

    def drain(self) -> None:
        """Forget everything that has arrived so far."""
        while self.poll(0.0):
            pass
        self.seen.clear()

    def until(self, wanted: Callable[[Any], bool], limit_s: float = 10.0) -> Any:
        deadline_s = time.monotonic() + limit_s
        while time.monotonic() < deadline_s:
            for message in self.poll():
                if wanted(message):
                    return message
        raise AssertionError(f"not seen in {limit_s} s: {self.texts()}")

    def message(self, name: str, limit_s: float = 10.0) -> Any:
        return self.until(lambda m: m.get_type() == name, limit_s)

    def command(self, number: int, *params: float, target: tuple[int, int] = (1, 1)) -> int:
        """Result of a COMMAND_LONG; the rest of the parameters is NaN as MAVSDK has it."""
        filled = [*params, *[math.nan] * (7 - len(params))]
        self.send(mav.MAVLink_command_long_message(*target, number, 0, *filled))
        ack = self.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number)
        assert (ack.target_system, ack.target_component) == (245, 190)
        assert (ack.get_srcSystem(), ack.get_srcComponent()) == (1, 1)
        return int(ack.result)

    def texts(self) -> list[str]:
        """Every STATUSTEXT so far, chunks joined."""
        joined: dict[tuple[int, int], str] = {}
        for at, message in enumerate(self.seen):
            if message.get_type() == "STATUSTEXT":
                key = (message.id, 0) if message.id else (0, at)
                joined[key] = joined.get(key, "") + message.text
        return list(joined.values())

    def told(self, text: str, limit_s: float = 10.0) -> None:
        """Wait for a STATUSTEXT, unless it has come already."""
        deadline_s = time.monotonic() + limit_s
        while text not in self.texts():
            assert time.monotonic() < deadline_s, f"'{text}' not among {self.texts()}"
            self.poll()

    def mode(self, mode: FlightMode) -> None:
        self.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == mode, 30.0)

    def ready(self) -> "Client":
        self.until(lambda m: m.get_type() == "SYS_STATUS" and m.onboard_control_sensors_health & 0x10000000 != 0)
        return self

    def close(self) -> None:
        self._connection.close()
