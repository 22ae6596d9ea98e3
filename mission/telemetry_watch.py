"""What does the vehicle say of itself right now?  The operator's view through MAVSDK's telemetry streams."""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from types import TracebackType
from typing import Any, Self

from mavsdk.asyncio import System
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync


class TelemetryWatch:
    """Latest values of the streams; ``changed`` wakes whoever waits for one of them."""

    def __init__(self, system: System, say: Callable[[str], None]) -> None:
        self.armed = False
        self.armable = False
        self.healthy = False
        self.connected = True
        self.mode = "UNKNOWN"
        self.landed = "UNKNOWN"
        self.t_s = 0.0  # vehicle time of the last LOCAL_POSITION_NED
        self.moved_wall_s = time.monotonic()  # when vehicle time last went on
        self.texts: list[str] = []
        self._system = system
        self._say = say
        self._changed = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> Self:
        """Subscribe to everything."""
        telemetry, direct = TelemetryAsync(self._system), MavlinkDirectAsync(self._system)
        self._follow(self._system.is_connected_state(), self._on_connected)
        self._follow(telemetry.subscribe_armed(), self._on_armed)
        self._follow(telemetry.subscribe_health(), self._on_health)
        self._follow(telemetry.subscribe_health_all_ok(), self._on_health_all_ok)
        self._follow(telemetry.subscribe_flight_mode(), self._on_mode)
        self._follow(telemetry.subscribe_landed_state(), self._on_landed)
        self._follow(telemetry.subscribe_status_text(), self._on_text)
        self._follow(direct.subscribe_message("LOCAL_POSITION_NED"), self._on_position)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Unsubscribe."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def until(self, reached: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until ``reached()`` holds; False when ``timeout_s`` of wall time went by first."""
        deadline_s = time.monotonic() + timeout_s
        while not reached():
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                return False
            self._changed.clear()
            try:
                await asyncio.wait_for(self._changed.wait(), left_s)
            except TimeoutError:
                return reached()
        return True

    def _follow(self, stream: AsyncIterator[Any], take: Callable[[Any], None]) -> None:
        async def follow() -> None:
            async for value in stream:
                take(value)
                self._changed.set()

        work: Coroutine[Any, Any, None] = follow()
        self._tasks.append(asyncio.create_task(work))

    def _on_connected(self, connected: bool) -> None:
        self.connected = connected

    def _on_armed(self, armed: bool) -> None:
        self.armed = armed

    def _on_health(self, health: Any) -> None:
        self.armable = health.is_armable

    def _on_health_all_ok(self, healthy: bool) -> None:
        self.healthy = healthy

    def _on_mode(self, mode: Any) -> None:
        self.mode = mode.name

    def _on_landed(self, landed: Any) -> None:
        self.landed = landed.name

    def _on_text(self, status: Any) -> None:
        self.texts.append(status.text)
        self._say(f"vehicle: {status.text}")

    def _on_position(self, message: Any) -> None:
        t_s = float(json.loads(message.fields_json)["time_boot_ms"]) / 1000.0
        if t_s != self.t_s:
            self.t_s = t_s
            self.moved_wall_s = time.monotonic()
