"""What do the sensors of a real PX4 read? HIL_SENSOR and HIL_GPS from the truth, with noise; vehicle time only.

IMU at every step, magnetometer and barometer at 50 Hz, GPS at 10 Hz. Same seed and truth: the same messages.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.frames import rotation_ned_frd
from companion.core.types import F64
from sitl.geo import Origin
from sitl.vehicle import Truth

Message = Any  # a MAVLink_*_message object

IMU_FIELDS: Final = 0x3F  # accelerometer and gyro
SLOW_FIELDS: Final = 0x1BC0  # magnetometer, pressure, pressure altitude, temperature
SLOW_STEPS: Final = 5  # 50 Hz at 250 Hz physics
GPS_STEPS: Final = 25  # 10 Hz
BLOCK: Final = 250  # noise is drawn for so many samples at once

# The field that PX4's own tables give for its home in Zurich, so that its heading is true.
DECLINATION_DEG: Final = 3.41
INCLINATION_DEG: Final = 63.16
FIELD_GAUSS: Final = 0.4824

# Standard atmosphere (ISO 2533)
SEA_LEVEL_HPA: Final = 1013.25
SEA_LEVEL_K: Final = 288.15
LAPSE_K_M: Final = 0.0065
EXPONENT: Final = 5.25588
ZERO_C_K: Final = 273.15

UNKNOWN_COURSE: Final = 65535
EPH_CM, EPV_CM, SATELLITES = 90, 178, 16  # what PX4's own GPS simulator reports


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations: white noise a sample, and biases that the seed draws once. GPS and baro are those of PX4's
    own simulators (sensor_gps_sim, sensor_baro_sim); IMU and magnetometer assumed, as of a small MEMS sensor."""

    acc_m_s2: float = 0.05
    acc_bias_m_s2: float = 0.02
    gyro_rad_s: float = 0.005
    gyro_bias_rad_s: float = 0.001
    mag_gauss: float = 0.002
    baro_hpa: float = 0.01
    gps_ne_m: float = 0.2
    gps_down_m: float = 0.5
    gps_vel_ne_m_s: float = 0.06
    gps_vel_down_m_s: float = 0.158


class HilSensors:
    """The sensors of one vehicle; ``read`` once a step."""

    def __init__(self, seed: int, origin: Origin | None = None, noise: SensorNoise | None = None) -> None:
        self._origin = origin or Origin()
        self._noise = noise or SensorNoise()
        imu, slow, gps, bias = np.random.SeedSequence(seed).spawn(4)
        self._imu_noise = _rows(np.random.default_rng(imu), 6)
        self._slow_noise = _rows(np.random.default_rng(slow), 4)
        self._gps_noise = _rows(np.random.default_rng(gps), 6)
        draws = np.random.default_rng(bias).standard_normal(6)
        self._acc_bias = (draws[:3] * self._noise.acc_bias_m_s2).tolist()
        self._gyro_bias = (draws[3:] * self._noise.gyro_bias_rad_s).tolist()
        self._field_ned_gauss = field_ned_gauss()
        self._slow: tuple[float, ...] = (0.0,) * 7  # as HIL_SENSOR has them, from xmag on

    def read(self, step: int, truth: Truth) -> list[Message]:
        """What is measured at a physics step: HIL_GPS when due, then HIL_SENSOR, whose time is PX4's clock."""
        time_us = round(truth.t_s * 1e6)
        slow = step % SLOW_STEPS == 0
        if slow:
            self._slow = self._measure_slow(truth)
        fields = IMU_FIELDS | (SLOW_FIELDS if slow else 0)
        sensor = mav.MAVLink_hil_sensor_message(time_us, *self._measure_imu(truth), *self._slow, fields)
        return [self._measure_gps(time_us, truth), sensor] if step % GPS_STEPS == 0 else [sensor]

    def _measure_imu(self, truth: Truth) -> list[float]:
        noise, white = self._noise, next(self._imu_noise)
        acc, gyro = truth.acc_frd_m_s2.tolist(), truth.rates_frd_rad_s.tolist()
        return [
            *(a + b + noise.acc_m_s2 * w for a, b, w in zip(acc, self._acc_bias, white[:3], strict=True)),
            *(r + b + noise.gyro_rad_s * w for r, b, w in zip(gyro, self._gyro_bias, white[3:], strict=True)),
        ]

    def _measure_slow(self, truth: Truth) -> tuple[float, ...]:
        noise, white = self._noise, next(self._slow_noise)
        field = (rotation_ned_frd(truth.q_ned_frd).T @ self._field_ned_gauss).tolist()
        mag = [f + noise.mag_gauss * w for f, w in zip(field, white[:3], strict=True)]
        alt_m = self._origin.alt_m(float(truth.pos_ned_m[2]))
        pressure_hpa = pressure_at(alt_m) + noise.baro_hpa * white[3]
        return (*mag, pressure_hpa, 0.0, alt_m, SEA_LEVEL_K - LAPSE_K_M * alt_m - ZERO_C_K)

    def _measure_gps(self, time_us: int, truth: Truth) -> Message:
        noise, white = self._noise, next(self._gps_noise)
        north_m, east_m, down_m = truth.pos_ned_m.tolist()
        lat_deg, lon_deg = self._origin.lat_lon_deg(
            north_m + noise.gps_ne_m * white[0], east_m + noise.gps_ne_m * white[1]
        )
        sigmas = (noise.gps_vel_ne_m_s, noise.gps_vel_ne_m_s, noise.gps_vel_down_m_s)
        vel = [v + s * w for v, s, w in zip(truth.vel_ned_m_s.tolist(), sigmas, white[3:], strict=True)]
        return mav.MAVLink_hil_gps_message(
            time_us,
            mav.GPS_FIX_TYPE_3D_FIX,
            round(lat_deg * 1e7),
            round(lon_deg * 1e7),
            round((self._origin.alt_m(down_m) + noise.gps_down_m * white[2]) * 1e3),
            EPH_CM,
            EPV_CM,
            round(math.hypot(vel[0], vel[1]) * 1e2),
            *(round(v * 1e2) for v in vel),
            UNKNOWN_COURSE,
            SATELLITES,
        )


def pressure_at(alt_m: float) -> float:
    """Pressure of the standard atmosphere in hPa."""
    return float(SEA_LEVEL_HPA * (1.0 - LAPSE_K_M * alt_m / SEA_LEVEL_K) ** EXPONENT)


def field_ned_gauss() -> F64:
    """The magnetic field (3,) at home, ned."""
    declination, inclination = math.radians(DECLINATION_DEG), math.radians(INCLINATION_DEG)
    level = FIELD_GAUSS * math.cos(inclination)
    return np.array((level * math.cos(declination), level * math.sin(declination), FIELD_GAUSS * math.sin(inclination)))


def _rows(rng: np.random.Generator, width: int) -> Iterator[list[float]]:
    """Rows of standard normal numbers without end."""
    while True:
        yield from rng.standard_normal((BLOCK, width)).tolist()
