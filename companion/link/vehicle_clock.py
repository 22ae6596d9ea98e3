"""What time is it on the vehicle, when only our own clock can be read? For a LiDAR that knows no vehicle time.

A state that arrives says: vehicle time is at least my stamp. The smallest delay seen in the last seconds is taken for
none at all, so the estimate lags by the fastest transport (a millisecond or two on a serial line). Pure.
"""

import math
from collections import deque

from companion.link.samples import REBOOT_S

WINDOW_S = 2.0  # of our clock: long enough to hold a quick packet, short enough to follow a vehicle's own pace
AHEAD_S = 0.1  # never further past the newest state: a vehicle clock that stands still is not run away from


class VehicleClock:
    """Vehicle time by our own clock, from the stamps of what was heard."""

    def __init__(self) -> None:
        self._newest_s = -math.inf
        self._offsets: deque[tuple[float, float]] = deque()  # our time, vehicle less our time: the latter falling

    @property
    def newest_s(self) -> float:
        """Vehicle time of the newest state heard; -inf before the first."""
        return self._newest_s

    def update(self, vehicle_s: float, now_s: float) -> None:
        """A state stamped ``vehicle_s`` is there at ``now_s`` of our clock; older and repeated ones teach nothing."""
        if vehicle_s < self._newest_s - REBOOT_S:
            self._newest_s = -math.inf
            self._offsets.clear()
        if not math.isfinite(vehicle_s) or vehicle_s <= self._newest_s:
            return
        self._newest_s = vehicle_s
        offset_s = vehicle_s - now_s
        while self._offsets and self._offsets[-1][1] <= offset_s:
            self._offsets.pop()
        self._offsets.append((now_s, offset_s))
        while now_s - self._offsets[0][0] > WINDOW_S:
            self._offsets.popleft()

    def at(self, now_s: float) -> float | None:
        """Vehicle time at ``now_s`` of our clock; None before a state was heard."""
        if not self._offsets:
            return None
        return min(now_s + self._offsets[0][1], self._newest_s + AHEAD_S)
