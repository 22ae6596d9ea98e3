"""When is a physics step due? Wall time in, steps and waits out; pure."""

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
        self._step_wall_s = step_s / speed  # wall time of one step
        self._wall_s = -math.inf  # when ``_step`` was due
        self._step = 0

    def restart(self) -> None:
        """Forget the past: vehicle time stood still."""
        self._wall_s = -math.inf

    def steps_due(self, wall_s: float, step: int, most: int) -> int:
        """Steps to advance now from ``step``, at most ``most``."""
        if self._step_wall_s == 0.0:
            return most
        self._follow(wall_s, step)
        due = self._step + math.floor((wall_s - self._wall_s) / self._step_wall_s + _EPSILON)
        return max(0, min(most, due - step))

    def wait_s(self, wall_s: float, step: int) -> float:
        """Wall time until ``step`` is due."""
        if self._step_wall_s == 0.0:
            return 0.0
        self._follow(wall_s, step)
        return max(0.0, self._wall_s + (step - self._step) * self._step_wall_s - wall_s)

    def _follow(self, wall_s: float, step: int) -> None:
        if wall_s - self._wall_s - (step - self._step) * self._step_wall_s > BEHIND_MAX_S:
            self._wall_s, self._step = wall_s, step
