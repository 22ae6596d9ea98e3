"""Which MAVSDK does this Python have? 3.17.4 and 4.1 behind one face, so that each conversation is told once.

``vehicle.action.arm()``, ``async for mode in vehicle.telemetry.flight_mode()``: names are those of 3.17.4. Places are
(north, east, down) from the origin of the estimate, in metres. Imports nothing of this project: it runs where only
MAVSDK is.
"""

import asyncio
import importlib
import math
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, asynccontextmanager
from importlib.metadata import version
from typing import Any

NATIVE = version("mavsdk") >= "4"  # before that, a mavsdk_server of its own behind gRPC
EARTH_RADIUS_M = 6371000.0
LIMIT_S = 60.0


def kinds(plugin: str) -> Any:
    """The module with the values of a plugin."""
    return importlib.import_module(f"mavsdk.plugins.{plugin}" if NATIVE else f"mavsdk.{plugin}")


class NativePlugin:
    """A plugin of 4.1: what it calls ``subscribe_mode`` is called ``mode``."""

    def __init__(self, system: Any, name: str) -> None:
        module = importlib.import_module(f"mavsdk.asyncio.plugins.{name}")
        self._plugin = getattr(module, f"{_title(name)}Async")(system)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plugin, f"subscribe_{name}", None) or getattr(self._plugin, name)


class Vehicle:
    """A vehicle as the client sees it; what it tells about itself is kept up to date."""

    def __init__(self, system: Any) -> None:
        self._system = system
        self._plugins: dict[str, Any] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self.mode = self.landed = ""
        self.armed = self.ready = False
        self.place_ned_m = (math.nan, math.nan, math.nan)
        self.texts: list[str] = []
        self.home: Any = None
        self._origin_deg = (math.nan, math.nan)

    def __getattr__(self, plugin: str) -> Any:
        if plugin not in self._plugins:
            self._plugins[plugin] = NativePlugin(self._system, plugin) if NATIVE else getattr(self._system, plugin)
        return self._plugins[plugin]

    async def watch(self) -> None:
        """Listen, until the vehicle says that it can be armed."""
        tell = self.telemetry
        streams: list[tuple[Callable[[], AsyncIterator[Any]], Callable[[Any], None]]] = [
            (tell.flight_mode, lambda mode: setattr(self, "mode", mode.name)),
            (tell.landed_state, lambda state: setattr(self, "landed", state.name)),
            (tell.armed, lambda armed: setattr(self, "armed", armed)),
            (tell.health, lambda h: setattr(self, "ready", h.is_armable and h.is_global_position_ok)),
            (tell.position_velocity_ned, self._moved),
            (tell.status_text, lambda text: self.texts.append(text.text)),
            (tell.home, lambda home: setattr(self, "home", home)),
        ]
        self._tasks = [asyncio.create_task(_keep(stream(), take)) for stream, take in streams]
        await self.until(lambda: self.ready and self.home is not None and not math.isnan(self.place_ned_m[0]))
        here = await first(tell.position())
        self._origin_deg = _shifted((here.latitude_deg, here.longitude_deg), -self.place_ned_m[0], -self.place_ned_m[1])

    def _moved(self, state: Any) -> None:
        self.place_ned_m = (state.position.north_m, state.position.east_m, state.position.down_m)

    async def until(self, fact: Callable[[], bool], limit_s: float = LIMIT_S) -> None:
        """Wait for what the vehicle says to be so."""
        deadline_s = time.monotonic() + limit_s
        while not fact():
            assert time.monotonic() < deadline_s, f"{self.mode} {self.landed} {self.place_ned_m} {self.texts}"
            await asyncio.sleep(0.02)

    async def near(self, north_m: float, east_m: float, down_m: float, radius_m: float = 0.8) -> None:
        """Wait until it is there."""
        await self.until(lambda: math.dist(self.place_ned_m, (north_m, east_m, down_m)) < radius_m)

    async def airborne(self, height_m: float) -> None:
        """Hold in the air: take off, where it stands on the ground."""
        if not self.armed:
            await self.until(lambda: self.ready)
            await self.action.set_takeoff_altitude(height_m)
            await self.action.arm()
            await self.action.takeoff()
            await self.until(lambda: self.mode == "HOLD" and self.place_ned_m[2] < 0.5 - height_m)

    async def down(self) -> None:
        """Land, until it disarms itself."""
        await self.action.land()
        await self.until(lambda: not self.armed and self.landed == "ON_GROUND")

    def lat_lon_deg(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Where that is on earth."""
        return _shifted(self._origin_deg, north_m, east_m)

    def from_home_m(self) -> float:
        """How far away home is, horizontally."""
        scale_m = math.radians(EARTH_RADIUS_M)
        lat_deg, lon_deg = self.lat_lon_deg(*self.place_ned_m[:2])
        east_m = (lon_deg - self.home.longitude_deg) * scale_m * math.cos(math.radians(lat_deg))
        return math.hypot((lat_deg - self.home.latitude_deg) * scale_m, east_m)

    async def close(self) -> None:
        """Stop listening."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


def _shifted(lat_lon_deg: tuple[float, float], north_m: float, east_m: float) -> tuple[float, float]:
    lat_deg, lon_deg = lat_lon_deg
    scale = math.degrees(1.0 / EARTH_RADIUS_M)
    return lat_deg + north_m * scale, lon_deg + east_m * scale / math.cos(math.radians(lat_deg))


async def _keep(stream: AsyncIterator[Any], take: Callable[[Any], None]) -> None:
    async for value in stream:
        take(value)


async def first(stream: Any, fits: Callable[[Any], bool] = lambda _: True, limit_s: float = LIMIT_S) -> Any:
    """The first value that fits."""

    async def look() -> Any:
        async with aclosing(stream):
            async for value in stream:
                if fits(value):
                    return value
        raise AssertionError("the stream ended")

    return await asyncio.wait_for(look(), limit_s)


async def finish(stream: AsyncIterator[Any]) -> None:
    """To the end of something with progress; both versions raise when it fails."""
    async for _ in stream:
        pass


async def refusal(plugin: str, call: Awaitable[Any], limit_s: float = LIMIT_S) -> str:
    """What the client says about something that cannot be."""
    error_type = getattr(kinds(plugin), f"{_title(plugin)}Error")
    try:
        await asyncio.wait_for(call, limit_s)
    except error_type as error:
        return str(error)
    raise AssertionError("it was not refused")


@asynccontextmanager
async def connected(url: str) -> AsyncIterator[Vehicle]:
    """The first autopilot at this address, once it can be armed."""
    async with _native(url) if NATIVE else _with_server(url) as system:
        vehicle = Vehicle(system)
        try:
            await vehicle.watch()
            yield vehicle
        finally:
            await vehicle.close()


@asynccontextmanager
async def _native(url: str) -> AsyncIterator[Any]:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.logging import log_subscribe

    log_subscribe(lambda *_: True)
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        await mavsdk.add_any_connection(url)
        system = await mavsdk.first_autopilot(LIMIT_S)
        assert system is not None, f"nobody at {url}"
        yield system
    finally:
        mavsdk.destroy()


@asynccontextmanager
async def _with_server(url: str) -> AsyncIterator[Any]:
    from mavsdk import System

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    system = System(port=port)
    try:
        await system.connect(system_address=url)
        await first(system.core.connection_state(), lambda state: state.is_connected)
        yield system
    finally:
        system._stop_mavsdk_server()  # else a thread that reads what it says keeps Python alive


def _title(plugin: str) -> str:
    return "".join(part.capitalize() for part in plugin.split("_"))
