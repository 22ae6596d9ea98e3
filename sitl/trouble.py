"""What goes wrong with one vehicle? Applies faults to physics, estimate and battery at every control tick; seeded.

Vehicle time only. Without faults nothing is touched and nothing is drawn.
"""

import math
from typing import Final

import numpy as np

from companion.core.types import F64, VehicleState
from sitl.autopilot import Autopilot
from sitl.battery import Battery
from sitl.estimate_errors import EstimateErrors
from sitl.faults import MOTORS, SENSORS_OFF, FaultBook
from sitl.vehicle import Truth, Vehicle, Wind

GUST_S: Final = 2.0  # assumed: time constant of a gust
_STREAM: Final = 0x6057  # keeps these draws apart from others of the same seed


class Trouble:
    """Everything that is not as it should be."""

    def __init__(self, book: FaultBook, seed: int, vehicle: Vehicle, wind: Wind | None) -> None:
        self.book = book
        self.errors = EstimateErrors(seed)
        self.battery = Battery()
        self.active: dict[str, float] = {}
        self._vehicle = vehicle
        self._wind_m_s: F64 = np.array((wind or Wind()).mean_ned_m_s)
        self._blown = False
        self._gust_m_s: F64 = np.zeros(2)
        self._motors: tuple[float, ...] = (1.0,) * len(MOTORS)
        self._random = np.random.default_rng((_STREAM, seed))
        self._discharged: float | None = None  # the battery fault that has been applied

    def update(self, t_s: float, dt_s: float, truth: Truth, autopilot: Autopilot) -> None:
        """One control tick, before the autopilot's."""
        self.battery.draw(dt_s, truth.thrust_norm, autopilot.armed, autopilot.params["SIM_BAT_MIN_PCT"] / 100)
        if not self.book.quiet:
            self.active = self.book.at(t_s)
            self._break_motors()
            self._blow(dt_s)
            self._discharge()
            self.errors.update(t_s, dt_s, self.active)
        guardian = autopilot.guardian
        guardian.remaining = self.battery.remaining
        guardian.position_ok = self.errors.position_ok
        guardian.attitude_ok = self.errors.attitude_ok
        guardian.sensors_ok = not any(name in SENSORS_OFF for name in self.active)
        guardian.motors_ok = min(self._motors) > 0.0
        guardian.gcs_blocked = "gcs_off" in self.active

    def estimate(self, t_s: float, truth: Truth) -> VehicleState:
        """What the autopilot believes."""
        errors = self.errors
        if not errors.any:
            return VehicleState(t_s, truth.pos_ned_m, truth.vel_ned_m_s, truth.q_ned_frd, truth.rates_frd_rad_s)
        return VehicleState(
            t_s,
            truth.pos_ned_m + errors.pos_ned_m,
            truth.vel_ned_m_s + errors.vel_ned_m_s,
            errors.attitude(truth),
            truth.rates_frd_rad_s + errors.rates_frd_rad_s,
        )

    def felt(self, truth: Truth) -> tuple[F64, F64]:
        """Specific force and body rates (3,) as the sensors give them."""
        errors = self.errors
        if not errors.any:
            return truth.acc_frd_m_s2, truth.rates_frd_rad_s
        return truth.acc_frd_m_s2 + errors.acc_frd_m_s2, truth.rates_frd_rad_s + errors.rates_frd_rad_s

    def shifted(self, pos_ned_m: F64, vel_ned_m_s: F64) -> tuple[F64, F64]:
        """Position and velocity demands (3,) as the loops, which know the truth, have to be given them."""
        errors = self.errors
        given = np.isfinite(pos_ned_m) | np.isfinite(vel_ned_m_s)
        forward = np.where(given, np.nan_to_num(vel_ned_m_s) - errors.vel_ned_m_s, math.nan)
        return pos_ned_m - errors.pos_ned_m, forward

    def _break_motors(self) -> None:
        motors = tuple(self.active.get(name, 1.0) for name in MOTORS)
        if motors != self._motors:
            self._motors = motors
            self._vehicle.set_effectiveness(motors)

    def _blow(self, dt_s: float) -> None:
        """Additional wind and gusts (first-order Gauss-Markov)."""
        sigma = self.active.get("gusts", 0.0)
        steady = np.array([self.active.get("wind_north", 0.0), self.active.get("wind_east", 0.0)])
        keep = math.exp(-dt_s / GUST_S)
        if sigma:
            draw = self._random.standard_normal(2) * sigma * math.sqrt(1.0 - keep**2)
            self._gust_m_s = self._gust_m_s * keep + draw
        else:
            self._gust_m_s = np.zeros(2)
        blows = bool(sigma or steady.any())
        if blows or self._blown:
            self._blown = blows
            more = np.append(steady + self._gust_m_s, 0.0)
            self._vehicle.blow((self._wind_m_s + more).tolist())

    def _discharge(self) -> None:
        left = self.active.get("battery")
        if left != self._discharged and left is not None:
            self.battery.remaining = min(self.battery.remaining, left)
        self._discharged = left
