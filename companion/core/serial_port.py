"""How do bytes travel over a serial line? 8N1, no flow control, through the system's terminal interface (POSIX)."""

import contextlib
import os
import termios
from collections.abc import Sequence

from companion.core.transport import Selectable, TransportError

CHUNK_BYTES = 4096
UNSENT_MAX_BYTES = 1 << 14  # older bytes are dropped: a late setpoint is worth nothing


class SerialPort:
    """A serial device opened raw and non-blocking."""

    def __init__(self, device: str, baud: int) -> None:
        """Open ``device``. Raises TransportError naming it."""
        self._name = f"serial://{device}:{baud}"
        self._unsent = bytearray()
        speed = getattr(termios, f"B{baud}", None)
        if not isinstance(speed, int):
            raise TransportError(f"serial {device}: this system has no baud rate {baud}")
        try:
            self._fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise TransportError(f"serial {device} cannot be opened: {error.strerror}") from error
        try:
            _make_raw(self._fd, speed)
        except termios.error as error:
            os.close(self._fd)
            raise TransportError(f"{device} is not a serial port: {error.args[-1]}") from error
        self._open = True

    @property
    def name(self) -> str:
        """The URL."""
        return self._name

    def fileno(self) -> int:
        """The device's file descriptor."""
        return self._fd

    def send(self, data: bytes) -> None:
        """Queue and write what the line takes."""
        self._unsent += data
        del self._unsent[: max(0, len(self._unsent) - UNSENT_MAX_BYTES)]
        try:
            while self._open and self._unsent:
                del self._unsent[: os.write(self._fd, self._unsent)]
        except BlockingIOError:
            return
        except OSError:  # unplugged
            self.close()

    def receive(self) -> list[bytes]:
        """The bytes that are waiting."""
        chunks: list[bytes] = []
        while self._open:
            try:
                chunk = os.read(self._fd, CHUNK_BYTES)
            except BlockingIOError:
                break
            except OSError:  # unplugged
                self.close()
                break
            if not chunk:
                break
            chunks.append(chunk)
        return chunks

    def files(self) -> Sequence[Selectable]:
        """The port itself."""
        return (self,) if self._open else ()

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def close(self) -> None:
        """Close the device."""
        if self._open:
            self._open = False
            with contextlib.suppress(OSError):
                os.close(self._fd)


def _make_raw(fd: int, speed: int) -> None:
    """8 data bits, no parity, one stop bit, no flow control, no translation, reads that do not wait."""
    *_, control_characters = termios.tcgetattr(fd)
    control_characters[termios.VMIN] = 0
    control_characters[termios.VTIME] = 0
    control = termios.CS8 | termios.CREAD | termios.CLOCAL
    termios.tcsetattr(fd, termios.TCSANOW, [0, 0, control, 0, speed, speed, control_characters])
