"""How do bytes travel over a serial line? 8N1, no flow control, through the system's terminal interface (POSIX).

A device that goes away (a plug pulled, an autopilot on USB that boots again) is silence; it is opened again as soon as
it is back, under the same name.
"""

import contextlib
import os
import termios
from collections.abc import Sequence

from companion.core.clock import Clock, SystemClock
from companion.core.transport import Selectable, TransportError

CHUNK_BYTES = 4096
UNSENT_MAX_BYTES = 1 << 14  # older bytes are dropped: a late setpoint is worth nothing
OPEN_AGAIN_S = 0.5  # between two attempts to get a lost device back
NO_DEVICE = -1


class SerialPort:
    """A serial device opened raw and non-blocking."""

    def __init__(self, device: str, baud: int, clock: Clock | None = None) -> None:
        """Open ``device``. Raises TransportError naming it."""
        self._name = f"serial://{device}:{baud}"
        self._device = device
        self._clock = clock or SystemClock()
        self._unsent = bytearray()
        speed = getattr(termios, f"B{baud}", None)
        if not isinstance(speed, int):
            raise TransportError(f"serial {device}: this system has no baud rate {baud}")
        self._speed = speed
        self._fd = _opened(device, speed)
        self._lost_s = 0.0  # when the device went away, or was looked for last
        self._wanted = True

    @property
    def name(self) -> str:
        """The URL."""
        return self._name

    def fileno(self) -> int:
        """The device's file descriptor."""
        return self._fd

    def send(self, data: bytes) -> None:
        """Queue and write what the line takes."""
        if not self._there():
            return
        self._unsent += data
        del self._unsent[: max(0, len(self._unsent) - UNSENT_MAX_BYTES)]
        try:
            while self._unsent:
                del self._unsent[: os.write(self._fd, self._unsent)]
        except BlockingIOError:
            return
        except OSError:  # unplugged
            self._lose()

    def receive(self) -> list[bytes]:
        """The bytes that are waiting."""
        chunks: list[bytes] = []
        while self._there():
            try:
                chunk = os.read(self._fd, CHUNK_BYTES)
            except BlockingIOError:
                break
            except OSError:  # unplugged
                self._lose()
                break
            if not chunk:
                self._check_hung_up()
                break
            chunks.append(chunk)
        return chunks

    def files(self) -> Sequence[Selectable]:
        """The port itself, while it is there."""
        return (self,) if self._fd != NO_DEVICE else ()

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def close(self) -> None:
        """Close the device for good."""
        self._wanted = False
        self._lose()

    def _there(self) -> bool:
        """Is the device open? A lost one is looked for now and then."""
        if self._fd != NO_DEVICE:
            return True
        now_s = self._clock.now_s()
        if not self._wanted or now_s - self._lost_s < OPEN_AGAIN_S:
            return False
        self._lost_s = now_s
        with contextlib.suppress(TransportError):  # not back yet
            self._fd = _opened(self._device, self._speed)
        return self._fd != NO_DEVICE

    def _check_hung_up(self) -> None:
        """Nothing to read: is the line quiet, or is nobody there any more? Only a device that is there has a mode."""
        try:
            termios.tcgetattr(self._fd)
        except termios.error:
            self._lose()

    def _lose(self) -> None:
        if self._fd != NO_DEVICE:
            with contextlib.suppress(OSError):
                os.close(self._fd)
        self._fd = NO_DEVICE
        self._lost_s = self._clock.now_s()
        self._unsent.clear()


def _opened(device: str, speed: int) -> int:
    """File descriptor of ``device``, set up. Raises TransportError naming it."""
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise TransportError(f"serial {device} cannot be opened: {error.strerror}") from error
    try:
        _make_raw(fd, speed)
    except termios.error as error:
        os.close(fd)
        raise TransportError(f"{device} is not a serial port: {error.args[-1]}") from error
    return fd


def _make_raw(fd: int, speed: int) -> None:
    """8 data bits, no parity, one stop bit, no flow control, no translation, reads that do not wait."""
    *_, control_characters = termios.tcgetattr(fd)
    control_characters[termios.VMIN] = 0
    control_characters[termios.VTIME] = 0
    control = termios.CS8 | termios.CREAD | termios.CLOCAL
    termios.tcsetattr(fd, termios.TCSANOW, [0, 0, control, 0, speed, speed, control_characters])
