"""A vehicle in a thread, and MAVSDK connected to it over UDP: what the tests with MAVSDK share."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.logging import log_subscribe
from mission_kit import open_world

from companion.core.clock import SystemClock
from sitl.flight_logs import FlightLogs
from sitl.link import bind, open_links
from sitl.server import RunConfig, Server
from sitl.simulation import SimConfig, Simulation

PORT = 14030  # of the operator


@contextmanager
def vehicle(
    instance: int, speed: float = 1.0, sim: SimConfig | None = None, folder: Path | None = None
) -> Iterator[Server]:
    """A vehicle on its ports, served by a thread; flight logs go into ``folder``."""
    clock = SystemClock()
    links = open_links(bind(instance, clock), 1, None, clock)
    logs = FlightLogs(folder) if folder is not None else None
    flown = Simulation(open_world(), sim or SimConfig(seed=2))
    server = Server(flown, links, RunConfig(speed=speed), clock, logs=logs)
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


class Pilot:
    """MAVSDK's view of the vehicle, kept up to date."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self.action = ActionAsync(system)
        self.telemetry = TelemetryAsync(system)
        self.mode = self.landed = ""
        self.armed = False
        self.ready = False
        self.position_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self.texts: list[str] = []
        self._tasks: list[asyncio.Task[None]] = []

    def watch(self) -> None:
        streams: list[tuple[Callable[[], AsyncIterator[Any]], Callable[[Any], None]]] = [
            (self.telemetry.subscribe_flight_mode, lambda m: setattr(self, "mode", m.name)),
            (self.telemetry.subscribe_landed_state, lambda s: setattr(self, "landed", s.name)),
            (self.telemetry.subscribe_armed, lambda a: setattr(self, "armed", a)),
            (
                self.telemetry.subscribe_health,
                lambda h: setattr(self, "ready", h.is_armable and h.is_global_position_ok),
            ),
            (self.telemetry.subscribe_position_velocity_ned, self._moved),
            (self.telemetry.subscribe_status_text, lambda t: self.texts.append(t.text)),
        ]
        self._tasks = [asyncio.create_task(self._keep(stream, take)) for stream, take in streams]

    async def _keep(self, stream: Callable[[], AsyncIterator[Any]], take: Callable[[Any], None]) -> None:
        async for value in stream():
            take(value)

    def _moved(self, state: Any) -> None:
        position = state.position
        self.position_ned_m = (position.north_m, position.east_m, position.down_m)

    async def until(self, fact: Callable[[], bool], limit_s: float = 60.0) -> None:
        deadline_s = time.monotonic() + limit_s
        while not fact():
            assert time.monotonic() < deadline_s, f"{self.mode} {self.landed} {self.position_ned_m} {self.texts}"
            await asyncio.sleep(0.02)

    async def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


@asynccontextmanager
async def client(instance: int) -> AsyncIterator[Pilot]:
    """MAVSDK as a ground station on the operator's link."""
    log_subscribe(lambda *_: True)
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{PORT + instance}")
        system = await mavsdk.first_autopilot(15.0)
        assert system is not None
        pilot = Pilot(system)
        pilot.watch()
        await pilot.until(lambda: pilot.ready, 20.0)
        yield pilot
        await pilot.close()
    finally:
        mavsdk.destroy()


def fly(
    instance: int,
    story: Callable[[Pilot], Awaitable[None]],
    speed: float,
    sim: SimConfig | None = None,
    folder: Path | None = None,
) -> None:
    """Run a story with a client and a vehicle of its own."""

    async def told() -> None:
        async with client(instance) as pilot:
            await story(pilot)

    with vehicle(instance, speed, sim, folder):
        asyncio.run(told())
