"""Has somebody asked the process to stop? Ctrl-C and SIGTERM as a value that the loop looks at."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
BY_SIGNAL = 128  # exit code of a shell command that a signal ended, less the signal's number


class StopRequest:
    """The first signal that arrived."""

    def __init__(self) -> None:
        self.number: int | None = None

    def set(self, number: int) -> None:
        """Ask to stop, as the signal would."""
        self.number = self.number or number

    @property
    def exit_code(self) -> int:
        """130 for Ctrl-C, 143 for SIGTERM."""
        return BY_SIGNAL + (self.number or 0)


@contextmanager
def stop_on_signals(request: StopRequest) -> Iterator[None]:
    """Route the signals into ``request``; call from the main thread only. The old handlers come back afterwards."""

    def handle(number: int, _frame: FrameType | None) -> None:
        request.set(number)

    before: dict[signal.Signals, Any] = {number: signal.signal(number, handle) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
