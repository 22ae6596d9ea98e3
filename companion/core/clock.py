"""What time is it outside the vehicle? Wall clocks for time-outs and log stamps; nothing that flies depends on them."""

import time
from typing import Protocol


class Clock(Protocol):
    """A source of wall time; tests put a ManualClock in its place."""

    def now_s(self) -> float:
        """Seconds that only ever grow; the origin means nothing."""

    def wall_us(self) -> int:
        """Microseconds since the UNIX epoch, for log stamps."""

    def sleep_s(self, duration_s: float) -> None:
        """Let ``duration_s`` pass."""


class SystemClock:
    """The machine's clocks."""

    def now_s(self) -> float:
        """Monotonic seconds."""
        return time.monotonic()

    def wall_us(self) -> int:
        """Microseconds since the UNIX epoch."""
        return time.time_ns() // 1000

    def sleep_s(self, duration_s: float) -> None:
        """Sleep; a negative duration is no sleep."""
        time.sleep(max(0.0, duration_s))


class ManualClock:
    """A clock that moves only when told, or when somebody sleeps on it."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        """The time it was moved to."""
        return self._now_s

    def wall_us(self) -> int:
        """The same instant in microseconds."""
        return round(self._now_s * 1e6)

    def sleep_s(self, duration_s: float) -> None:
        """Move on by ``duration_s``."""
        self._now_s += max(0.0, duration_s)
