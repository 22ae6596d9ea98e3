"""How wrong is the autopilot's estimate? Drift, noise and outages of sensors, seeded; moved on at every control tick.

Local ned. Estimate = truth + error, while the control loops know the truth: what they are asked for is shifted by the
error, which flies the same. Without a fault the error is none at all, and nothing is drawn.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from companion.core.frames import euler_rad, quaternion
from companion.core.types import F64
from sitl.vehicle import Truth

LOST_AFTER_S: Final = 5.0  # EKF2_NOAID_TOUT: without aid for longer, the position is not valid
COAST_ACC_M_S2: Final = 0.1  # assumed: accelerometer bias and tilt error of a small autopilot without GPS
HEAL_S: Final = 1.0  # assumed: time constant at which the estimate comes back to a returned GPS
_NO_GPS: Final = ("gps_off", "gps_stuck")
_NO_ATTITUDE: Final = ("gyro_off", "accel_off")
_STREAM: Final = 0xE57  # keeps these draws apart from others of the same seed


class EstimateErrors:
    """The errors at the last control tick."""

    def __init__(self, seed: int) -> None:
        self.pos_ned_m: F64 = np.zeros(3)
        self.vel_ned_m_s: F64 = np.zeros(3)
        self.rates_frd_rad_s: F64 = np.zeros(3)
        self.acc_frd_m_s2: F64 = np.zeros(3)
        self.tilt_rad: F64 = np.zeros(3)
        self.any = False  # has anything ever been wrong?
        self.count = 0  # grows with every change
        self.gps_ok = True
        self.position_ok = True
        self.attitude_ok = True
        self._walk_m: F64 = np.zeros(3)
        self._coast_m: F64 = np.zeros(3)
        self._coast_m_s: F64 = np.zeros(3)
        self._coast_acc: F64 | None = None  # while GPS is missing
        self._unaided_since_s = math.inf
        self._random = np.random.default_rng((_STREAM, seed))

    def update(self, t_s: float, dt_s: float, faults: Mapping[str, float]) -> None:
        """One control tick."""
        self.any = self.any or bool(faults)
        if not self.any:
            return
        self.count += 1
        self._drift(dt_s, faults)
        self._outage(t_s, dt_s, faults)
        self.pos_ned_m = self._walk_m + self._coast_m
        self.vel_ned_m_s = self._coast_m_s + self._noise(faults.get("velocity_noise", 0.0))
        self.rates_frd_rad_s = self._noise(faults.get("gyro_noise", 0.0))
        self.acc_frd_m_s2 = self._noise(faults.get("accel_noise", 0.0))
        self.tilt_rad = self._noise(math.radians(faults.get("attitude_noise", 0.0)))

    def attitude(self, truth: Truth) -> F64:
        """The estimated attitude (4,)."""
        return quaternion(*(np.array(euler_rad(truth.q_ned_frd)) + self.tilt_rad).tolist())

    def _drift(self, dt_s: float, faults: Mapping[str, float]) -> None:
        """Random walks: the rms grows with the square root of time and is the value after a minute."""
        root = math.sqrt(dt_s / 60.0)
        level = faults.get("position_drift", 0.0) * root / math.sqrt(2.0)
        if level or "baro_drift" in faults:
            step = self._random.standard_normal(3) * (level, level, faults.get("baro_drift", 0.0) * root)
            self._walk_m = self._walk_m + step

    def _outage(self, t_s: float, dt_s: float, faults: Mapping[str, float]) -> None:
        self.gps_ok = not any(name in faults for name in _NO_GPS)
        attitude_ok = self.attitude_ok = not any(name in faults for name in _NO_ATTITUDE)
        if self.gps_ok and attitude_ok:
            self._unaided_since_s, self._coast_acc, self.position_ok = math.inf, None, True
            keep = math.exp(-dt_s / HEAL_S)
            self._coast_m, self._coast_m_s = self._coast_m * keep, self._coast_m_s * keep
            return
        if self._coast_acc is None:
            away_rad = self._random.uniform(-math.pi, math.pi)
            self._coast_acc = COAST_ACC_M_S2 * np.array([math.cos(away_rad), math.sin(away_rad), 0.0])
        self._unaided_since_s = min(self._unaided_since_s, t_s)
        self.position_ok = attitude_ok and t_s - self._unaided_since_s <= LOST_AFTER_S
        self._coast_m_s = self._coast_m_s + self._coast_acc * dt_s
        self._coast_m = self._coast_m + self._coast_m_s * dt_s

    def _noise(self, sigma: float) -> F64:
        return self._random.standard_normal(3) * sigma if sigma else np.zeros(3)
