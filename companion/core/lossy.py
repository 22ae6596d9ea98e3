"""What does a bad radio do to a link? A wrapper that loses, doubles, delays and reorders chunks, by seed."""

import heapq
import itertools
import random
from collections.abc import Sequence
from dataclasses import dataclass

from companion.core.clock import Clock, SystemClock
from companion.core.transport import Selectable, Transport, wait_readable


@dataclass(frozen=True, slots=True)
class Loss:
    """How bad the link is; every chunk draws for itself."""

    loss: float = 0.0  # probability that a chunk is lost
    duplicate: float = 0.0  # probability that it arrives twice
    delay_s: float = 0.0  # every chunk is late by this
    jitter_s: float = 0.0  # and by up to this more: chunks overtake each other


class LossyTransport:
    """A transport whose both directions suffer."""

    def __init__(self, inner: Transport, loss: Loss, seed: int, clock: Clock | None = None) -> None:
        self._inner = inner
        self._clock = clock or SystemClock()
        self._outgoing = _Delay(loss, random.Random(f"{seed}/out"))
        self._incoming = _Delay(loss, random.Random(f"{seed}/in"))

    @property
    def name(self) -> str:
        """The inner URL."""
        return self._inner.name

    def send(self, data: bytes) -> None:
        """Send, perhaps, later, twice."""
        self._outgoing.put(data, self._clock.now_s())
        self._flush()

    def receive(self) -> list[bytes]:
        """The chunks whose time has come."""
        self._flush()
        return self._incoming.due(self._clock.now_s())

    def files(self) -> Sequence[Selectable]:
        """None: chunks become due without anything happening on the socket."""
        return ()

    def ready(self) -> bool:
        """True when a chunk is due."""
        self._flush()
        return self._incoming.has_due(self._clock.now_s())

    def close(self) -> None:
        """Close the inner transport; what is still on its way is lost."""
        self._inner.close()

    def _flush(self) -> None:
        now_s = self._clock.now_s()
        for chunk in self._outgoing.due(now_s):
            self._inner.send(chunk)
        if wait_readable([self._inner], 0.0, self._clock):
            for chunk in self._inner.receive():
                self._incoming.put(chunk, now_s)


class _Delay:
    """Chunks on their way, ordered by the time they are due."""

    def __init__(self, loss: Loss, rng: random.Random) -> None:
        self._loss = loss
        self._rng = rng
        self._count = itertools.count()
        self._queue: list[tuple[float, int, bytes]] = []

    def put(self, chunk: bytes, now_s: float) -> None:
        if self._rng.random() < self._loss.loss:
            return
        copies = 2 if self._rng.random() < self._loss.duplicate else 1
        for _ in range(copies):
            due_s = now_s + self._loss.delay_s + self._rng.random() * self._loss.jitter_s
            heapq.heappush(self._queue, (due_s, next(self._count), chunk))

    def has_due(self, now_s: float) -> bool:
        return bool(self._queue) and self._queue[0][0] <= now_s

    def due(self, now_s: float) -> list[bytes]:
        chunks: list[bytes] = []
        while self.has_due(now_s):
            chunks.append(heapq.heappop(self._queue)[2])
        return chunks
