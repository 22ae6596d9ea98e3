"""What was the vehicle's state at an instant? Samples by time stamp, interpolated; pure, vehicle time.

An instant that was sampled gives that sample, bit for bit. Between samples the values are interpolated; a little past
the newest one they are extrapolated with velocity and body rates, since the sample after a scan comes after the scan.
"""

import bisect
import math

import numpy as np

from companion.core.types import F64, VehicleState

CAPACITY = 128  # samples kept: more than a second at PX4's fastest stream
REBOOT_S = 1.0  # a sample this much older than the newest means that the vehicle's clock started again


class Samples:
    """Two values by time stamp: a vector with its rate of change."""

    def __init__(self) -> None:
        self._t_s: list[float] = []
        self._values: list[tuple[F64, F64]] = []

    @property
    def newest_s(self) -> float:
        """Time of the newest sample; -inf without any."""
        return self._t_s[-1] if self._t_s else -math.inf

    def put(self, t_s: float, value: F64, rate: F64) -> None:
        """Keep a sample; late and repeated ones find their place."""
        at = bisect.bisect_left(self._t_s, t_s)
        if at < len(self._t_s) and self._t_s[at] == t_s:
            return
        self._t_s.insert(at, t_s)
        self._values.insert(at, (value, rate))
        if len(self._t_s) > CAPACITY:
            del self._t_s[0], self._values[0]

    def clear(self) -> None:
        """Forget everything."""
        self._t_s.clear()
        self._values.clear()

    def gap_s(self, t_s: float) -> float:
        """How far the nearest sample is from an instant; inf without samples."""
        at = bisect.bisect_left(self._t_s, t_s)
        return min((abs(t_s - sample_s) for sample_s in self._t_s[max(0, at - 1) : at + 1]), default=math.inf)

    def around(self, t_s: float) -> tuple[tuple[F64, F64], tuple[F64, F64], float]:
        """The samples before and after an instant and the share of the second in [0, 1].

        Outside the samples both are the outermost one. Raises IndexError without samples.
        """
        at = bisect.bisect_left(self._t_s, t_s)
        if at == len(self._t_s):
            return self._values[-1], self._values[-1], 0.0
        if at == 0 or self._t_s[at] == t_s:
            return self._values[at], self._values[at], 0.0
        before_s, after_s = self._t_s[at - 1], self._t_s[at]
        return self._values[at - 1], self._values[at], (t_s - before_s) / (after_s - before_s)


def state_at(position: Samples, attitude: Samples, t_s: float, max_age_s: float) -> VehicleState:
    """The state at an instant; extrapolated by at most ``max_age_s``. Raises IndexError without samples."""
    pos, vel = _linear(position, t_s)
    q, rates = _linear(attitude, t_s)
    ahead_s = min(max(0.0, t_s - position.newest_s), max_age_s)
    if ahead_s > 0.0:
        pos = pos + vel * ahead_s
    q_ahead_s = min(max(0.0, t_s - attitude.newest_s), max_age_s)
    if q_ahead_s > 0.0:
        q = _turned(q, rates, q_ahead_s)
    return VehicleState(t_s=t_s, pos_ned_m=pos, vel_ned_m_s=vel, q_ned_frd=q, rates_frd_rad_s=rates)


def _linear(samples: Samples, t_s: float) -> tuple[F64, F64]:
    """Value and rate at an instant; quaternions (four components) stay of unit length and on the short way."""
    (value, rate), (value_after, rate_after), share = samples.around(t_s)
    if share == 0.0:
        return value, rate
    if len(value) == 4:
        nearer = value_after if float(value @ value_after) >= 0.0 else -value_after
        return _unit(value + share * (nearer - value)), rate + share * (rate_after - rate)
    return value + share * (value_after - value), rate + share * (rate_after - rate)


def _turned(q_ned_frd: F64, rates_frd_rad_s: F64, duration_s: float) -> F64:
    """First-order turn by constant body rates: q + q*(0, rates)*dt/2."""
    w, x, y, z = q_ned_frd.tolist()
    p, q, r = rates_frd_rad_s.tolist()
    turn = np.array(
        (
            -x * p - y * q - z * r,
            w * p + y * r - z * q,
            w * q - x * r + z * p,
            w * r + x * q - y * p,
        )
    )
    return _unit(q_ned_frd + turn * (duration_s / 2))


def _unit(q: F64) -> F64:
    norm = math.sqrt(float(q @ q))
    return q / norm if norm > 0.0 else q
