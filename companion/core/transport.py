"""How do bytes travel between two programs? The interface, an in-process pair, and waiting for several at once.

No threads, no callbacks: a transport never blocks, ``wait_readable`` is the only place that does. Trouble on a link in
flight (a partner gone, a full buffer) is silence, not an exception; only opening raises TransportError.
"""

import select
from collections import deque
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from companion.core.clock import Clock, SystemClock

POLL_S = 0.001  # how often transports without a file descriptor are looked at


class TransportError(OSError):
    """A transport cannot be opened; the text is one line for the user and names the port or device."""


class Selectable(Protocol):
    """Anything ``select`` takes."""

    def fileno(self) -> int:
        """File descriptor."""


class Waitable(Protocol):
    """Anything that ``wait_readable`` takes."""

    def files(self) -> Sequence[Selectable]:
        """What to select on; empty = must be polled through ``ready``."""

    def ready(self) -> bool:
        """True when there may be something that ``select`` cannot see."""


class Transport(Protocol):
    """Bytes to and from one or several partners."""

    @property
    def name(self) -> str:
        """The URL, for logs."""

    def send(self, data: bytes) -> None:
        """Send to every partner known now; nobody there is not an error."""

    def receive(self) -> list[bytes]:
        """Chunks that arrived since the last call, oldest first; never blocks."""

    def files(self) -> Sequence[Selectable]:
        """What to select on; empty = must be polled through ``ready``."""

    def ready(self) -> bool:
        """True when ``receive`` may have something that ``select`` cannot see."""

    def close(self) -> None:
        """Free the port; may be called twice."""


@runtime_checkable
class Vouchable(Protocol):
    """A transport with partners that anybody can become by speaking to it."""

    def vouch(self, chunk: bytes) -> None:
        """Who sent this received chunk can be trusted: from now on only such partners are answered."""


def wait_readable(transports: Sequence[Waitable], timeout_s: float, clock: Clock | None = None) -> bool:
    """Wait until one of the transports may have data, at most ``timeout_s``. Returns whether one has."""
    clock = clock or SystemClock()
    deadline_s = clock.now_s() + timeout_s
    while True:
        if any(transport.ready() for transport in transports):
            return True
        files = [file for transport in transports for file in transport.files()]
        polled = any(not transport.files() for transport in transports)
        left_s = max(0.0, deadline_s - clock.now_s())
        if _select(files, min(left_s, POLL_S) if polled else left_s, clock):
            return True
        if left_s <= 0.0:
            return False


def pair(name: str = "pair://") -> tuple["PairEnd", "PairEnd"]:
    """Two transports joined inside this process."""
    there: deque[bytes] = deque()
    back: deque[bytes] = deque()
    return PairEnd(name, there, back), PairEnd(name, back, there)


class PairEnd:
    """One end of an in-process pair."""

    def __init__(self, name: str, outgoing: deque[bytes], incoming: deque[bytes]) -> None:
        self._name = name
        self._outgoing = outgoing
        self._incoming = incoming
        self._open = True

    @property
    def name(self) -> str:
        """The name given to ``pair``."""
        return self._name

    def send(self, data: bytes) -> None:
        """Hand over to the other end."""
        if self._open:
            self._outgoing.append(bytes(data))

    def receive(self) -> list[bytes]:
        """Everything that the other end sent."""
        chunks: list[bytes] = []
        while self._incoming:
            chunks.append(self._incoming.popleft())
        return chunks

    def files(self) -> Sequence[Selectable]:
        """Nothing to select on."""
        return ()

    def ready(self) -> bool:
        """True when something is waiting."""
        return bool(self._incoming)

    def close(self) -> None:
        """Stop sending."""
        self._open = False


def _select(files: list[Selectable], timeout_s: float, clock: Clock) -> bool:
    if not files:
        clock.sleep_s(timeout_s)
        return False
    readable, _, _ = select.select(files, [], [], timeout_s)
    return bool(readable)
