"""Up to which physics step may the vehicle be at this wall time? Wall time in, steps out; pure."""

import math
from typing import Final

BEHIND_MAX_S: Final = 0.25  # wall time: a vehicle that is further behind goes on from where it is

_EPSILON: Final = 1e-9


class Pacer:
    """Vehicle time at ``speed`` times wall time; infinite speed paces nothing."""

    def __init__(self, speed: float, step_s: float) -> None:
        """Raises ValueError for a speed that is not above zero."""
        if not speed > 0.0:
            raise ValueError(f"speed {speed} is not above 0")
        self._speed = speed
        self._step_s = step_s
        self._wall_s = math.nan
        self._step = 0

    def restart(self) -> None:
        """Forget the past: vehicle time stood still."""
        self._wall_s = math.nan

    def steps_due(self, wall_s: float, step: int, most: int) -> int:
        """Steps to advance now from ``step``, at most ``most``."""
        if math.isinf(self._speed):
            return most
        if math.isnan(self._wall_s):
            self._wall_s, self._step = wall_s, step
        due = self._step + math.floor((wall_s - self._wall_s) * self._speed / self._step_s + _EPSILON)
        if (due - step) * self._step_s / self._speed > BEHIND_MAX_S:
            self._wall_s, self._step = wall_s, step
            return most
        return max(0, min(most, due - step))

    def wait_s(self, wall_s: float, step: int) -> float:
        """Wall time until ``step`` is due."""
        if math.isinf(self._speed) or math.isnan(self._wall_s):
            return 0.0
        return max(0.0, self._wall_s + (step - self._step) * self._step_s / self._speed - wall_s)
