"""Where does the wall time of training go?  Seconds by name; a part inside another is taken out of the outer one."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Seconds of wall time spent under each name, nested parts counted once."""

    def __init__(self, seconds: dict[str, float] | None = None) -> None:
        self.seconds: dict[str, float] = dict(seconds or {})
        self._open: list[tuple[str, float]] = []  # name, since when it is the innermost

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count what runs inside under ``name`` and not under the part around it."""
        now_s = time.perf_counter()
        self._close_innermost(now_s)
        self._open.append((name, now_s))
        try:
            yield
        finally:
            now_s = time.perf_counter()
            self._close_innermost(now_s)
            self._open.pop()
            if self._open:
                self._open[-1] = (self._open[-1][0], now_s)

    def move(self, seconds: float, old: str, new: str) -> None:
        """Count so much of the time under ``old`` as ``new`` instead."""
        self.seconds[old] = self.seconds.get(old, 0.0) - seconds
        self.seconds[new] = self.seconds.get(new, 0.0) + seconds

    def _close_innermost(self, now_s: float) -> None:
        if self._open:
            name, since_s = self._open[-1]
            self.seconds[name] = self.seconds.get(name, 0.0) + now_s - since_s
