"""What does a LiDAR on a serial port of this computer see? Models of the package ``lds2d`` (extra ``hw``).

Tested against lds2d's parsers through a pseudo terminal, not on hardware. lds2d reads in a loop that waits, so it has
a thread of its own; sweeps come out of it through a queue. An unplugged device is silence until it is back. A sweep is
stamped with the middle of its revolution; it is not corrected for the vehicle's motion meanwhile.
"""

import contextlib
import math
import socket
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from companion.core.clock import Clock, SystemClock
from companion.core.mavlink import Connection
from companion.core.params import nearest
from companion.core.transport import Selectable, Waitable
from companion.core.types import F64
from companion.link.lidar import LidarError, scan_message
from companion.link.lidar_params import LidarParams
from companion.link.sweep import scan_of
from companion.link.vehicle_clock import VehicleClock

Message = Any  # a MAVLink_*_message object
Sweep = tuple[float, F64, F64]  # middle by our clock, angles as the LiDAR counts them, ranges in metres

READ_TIMEOUT_S = 0.1
OPEN_AGAIN_S = 0.5
QUEUE_SWEEPS = 8  # older ones are worth nothing
GAP_S = 1.0  # a sweep that took longer was interrupted: when its rays were measured is not known


class _ClosedError(Exception):
    """Somebody has closed the LiDAR: leave the reading loop."""


class SerialLidar:
    """One lds2d driver, read in a thread."""

    local = True

    def __init__(
        self, model: str, device: str, baud: int | None, params: LidarParams, clock: Clock | None = None
    ) -> None:
        """Open ``device``. Raises LidarError: extra missing, model unknown, device not there."""
        self.name = f"lds2d:{model}:{device}" + (f":{baud}" if baud else "")
        self._params = params
        self._clock = clock or SystemClock()
        self._lds2d = _package()
        self._driver_class = _driver_class(self._lds2d, model)
        self._address = (device, baud or self._driver_class.DEFAULT_BAUD)
        self._sweeps: deque[Sweep] = deque(maxlen=QUEUE_SWEEPS)
        self._number = 0
        self._closing = threading.Event()
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        self._port = self._opened()
        self._thread = threading.Thread(target=self._read, name=self.name, daemon=True)
        self._thread.start()

    def receive(self, clock: VehicleClock) -> list[Message]:
        """The sweeps that are complete, in vehicle time; dropped while that is not known."""
        with contextlib.suppress(BlockingIOError):
            self._wake_in.recv(4096)
        messages = []
        while self._sweeps:
            measured_s, angle_rad, range_m = self._sweeps.popleft()
            t_s = clock.at(measured_s - self._params.latency_s)
            if t_s is not None:
                messages.append(scan_message(scan_of(t_s, angle_rad, range_m, self._params, self._number)))
                self._number += 1
        return messages

    def files(self) -> Sequence[Selectable]:
        """A socket that becomes readable with the next sweep."""
        return (self._wake_in,) if not self._closing.is_set() else ()

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def waits_on(self) -> Sequence[Waitable]:
        """Itself."""
        return (self,)

    def links(self) -> Sequence[Connection]:
        """None."""
        return ()

    def close(self) -> None:
        """Stop the thread and free the device; may be called twice."""
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join()
            self._wake_in.close()
            self._wake_out.close()

    # --- the reading thread ---------------------------------------------------------------------------------------

    def _read(self) -> None:
        """Until closed; a device that fails is opened again."""
        while not self._closing.is_set():
            try:
                self._read_sweeps()
            except _ClosedError:
                break
            except (OSError, ValueError, LookupError, self._lds2d.LidarError):  # unplugged, or garbage on the line
                self._closing.wait(OPEN_AGAIN_S)
                with contextlib.suppress(LidarError):  # not back yet
                    self._port.close()
                    self._port = self._opened()
        self._port.close()

    def _read_sweeps(self) -> None:
        driver = self._driver_class(_Tap(self._port, self._closing))
        with contextlib.suppress(self._lds2d.NotSupportedError):  # turns by itself
            driver.start()
        for sweep in self._timed(driver.scans()):
            self._sweeps.append(sweep)
            with contextlib.suppress(BlockingIOError):  # it has been woken already
                self._wake_out.send(b"x")

    def _timed(self, scans: Iterator[Any]) -> Iterator[Sweep]:
        """Whole revolutions with the instant of their middle; the first one after a gap has no known beginning."""
        began_s = -math.inf
        for scan in scans:
            ended_s = self._clock.now_s()
            if ended_s - began_s <= GAP_S and len(scan.points) > 0:
                angle_rad = np.radians([point.angle_deg for point in scan.points])
                range_m = np.array([point.dist_mm for point in scan.points], dtype=np.float64) / 1e3
                yield (began_s + ended_s) / 2, angle_rad, range_m
            began_s = ended_s

    def _opened(self) -> Any:
        from lds2d.transport import SerialTransport

        device, baud = self._address
        try:
            return SerialTransport(device, baud, timeout=READ_TIMEOUT_S)
        except (OSError, ValueError) as error:  # pyserial: no device, no such rate
            reason = getattr(error, "strerror", None) or str(error)
            raise LidarError(f"{self.name}: {device} cannot be opened: {reason.splitlines()[0]}") from error


class _Tap:
    """lds2d's transport that can be left: its drivers read for ever."""

    def __init__(self, port: Any, closing: threading.Event) -> None:
        self._port = port
        self._closing = closing

    def read(self, size: int) -> bytes:
        """What has come within the time-out. Raises _ClosedError once the LiDAR was closed."""
        if self._closing.is_set():
            raise _ClosedError
        return bytes(self._port.read(size))

    def write(self, data: bytes) -> int:
        """Pass on."""
        return int(self._port.write(data))

    def reset_input(self) -> None:
        """Pass on."""
        self._port.reset_input()

    def close(self) -> None:
        """The port belongs to the thread, which opens it again."""


def _package() -> Any:
    """lds2d. Raises LidarError naming the extra."""
    try:
        import lds2d
        import serial  # noqa: F401  (lds2d imports it late)
    except ModuleNotFoundError as error:
        raise LidarError(f"a serial LiDAR needs the 'hw' extra: pip install 'swiftnav[hw]' ({error})") from error
    return lds2d


def _driver_class(lds2d: Any, model: str) -> Any:
    """The driver of a model. Raises LidarError with the nearest name."""
    from lds2d.core import driver_for

    driver = driver_for(model)
    if driver is None:
        raise LidarError(f"lds2d knows no LiDAR '{model}'{nearest(model.upper(), lds2d.available_models())}")
    if driver.NEEDS_MOTOR:
        raise LidarError(f"lds2d:{model} turns only while a program drives its motor: choose one that turns by itself")
    return driver
