"""How does a flight get a bad radio?  A relay between vehicle and companion whose both directions suffer."""

import threading
from types import TracebackType
from typing import Final, Self

from companion.core.clock import Clock, SystemClock
from companion.core.lossy import Loss, LossyTransport
from companion.core.transport import wait_readable
from companion.core.udp import udp_in, udp_out
from sitl.link import HOST

WAIT_S: Final = 0.05

BAD_RADIO: Final = Loss(loss=0.3, duplicate=0.1, delay_s=0.2, jitter_s=0.1)


class Relay:
    """Passes on what arrives at ``port`` to ``onward`` and back, while the context lasts; losses are drawn by seed."""

    def __init__(self, port: int, onward: int, loss: Loss, seed: int, clock: Clock | None = None) -> None:
        """Raises TransportError naming a port that somebody else has."""
        self.passed = {"onward": 0, "back": 0}
        self._clock = clock or SystemClock()
        self._near = LossyTransport(udp_in(HOST, port, self._clock), loss, seed, self._clock)
        self._far = udp_out(HOST, onward, clock=self._clock)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay")

    def __enter__(self) -> Self:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop and free the ports."""
        self._done.set()
        self._thread.join()
        self._near.close()
        self._far.close()

    def _run(self) -> None:
        while not self._done.is_set():
            wait_readable([self._near, self._far], WAIT_S, self._clock)
            for chunk in self._near.receive():
                self.passed["onward"] += 1
                self._far.send(chunk)
            for chunk in self._far.receive():
                self.passed["back"] += 1
                self._near.send(chunk)
