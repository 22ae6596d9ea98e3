"""Do the sensors of the simulator link read what is there? Compared with the truth, with figures written down here."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core.frames import quaternion, rotation_ned_frd
from sitl.hil_sensors import HilSensors, SensorNoise
from sitl.vehicle import Truth

SILENT = SensorNoise(*[0.0] * 10)
FIELD_NED_GAUSS = np.array([0.2175, 0.0130, 0.4304])  # Zurich: 3.4 deg east, 63.2 deg down, 0.482 G


def truth(q: np.ndarray | None = None, pos: tuple[float, float, float] = (0, 0, 0), t_s: float = 0.1) -> Truth:
    still = np.array([0.0, 0.0, -9.80665])
    level = quaternion(0.0, 0.0, 0.0)
    return Truth(
        t_s, np.array(pos, dtype=float), np.array([1.0, -2.0, 0.5]), level if q is None else q, np.zeros(3), still,
        False, 0.45,
    )  # fmt: skip


def read(noise: SensorNoise, seed: int = 0, step: int = 25, **where: Any) -> tuple[Any, Any]:
    """HIL_GPS and HIL_SENSOR of a step at which everything is due."""
    gps, sensor = HilSensors(seed, noise=noise).read(step, truth(**where))
    return gps, sensor


def test_without_noise_the_imu_reads_the_truth() -> None:
    _, sensor = read(SILENT)
    assert (sensor.xacc, sensor.yacc, sensor.zacc) == pytest.approx((0.0, 0.0, -9.80665))
    assert (sensor.xgyro, sensor.ygyro, sensor.zgyro) == (0.0, 0.0, 0.0)
    assert sensor.time_usec == 100_000


@settings(max_examples=40, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1))
def test_the_magnetometer_reads_the_same_field_in_any_attitude(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion(roll, pitch, yaw)
    _, sensor = read(SILENT, q=q)
    field = rotation_ned_frd(q) @ np.array([sensor.xmag, sensor.ymag, sensor.zmag])
    assert field == pytest.approx(FIELD_NED_GAUSS, abs=2e-3)


def test_a_metre_up_is_twelve_pascal_less() -> None:
    (_, low), (_, high) = read(SILENT), read(SILENT, pos=(0, 0, -10.0))
    assert (low.abs_pressure - high.abs_pressure) * 100 == pytest.approx(114.5, rel=0.02)
    assert high.pressure_alt - low.pressure_alt == pytest.approx(10.0)


def test_gps_reads_place_and_velocity_in_its_own_units() -> None:
    gps, _ = read(SILENT, pos=(100.0, 50.0, -20.0))
    north_m = math.radians(gps.lat / 1e7 - 47.397742) * 6371000
    east_m = math.radians(gps.lon / 1e7 - 8.545594) * 6371000 * math.cos(math.radians(47.397742))
    assert (north_m, east_m) == pytest.approx((100.0, 50.0), abs=0.03)
    assert gps.alt / 1e3 == pytest.approx(509.4)
    assert (gps.vn, gps.ve, gps.vd, gps.vel) == (100, -200, 50, 224)
    assert gps.cog == 65535
    assert gps.fix_type == mav.GPS_FIX_TYPE_3D_FIX


def test_noise_has_the_size_that_it_is_given() -> None:
    sensors = HilSensors(4, noise=SensorNoise(acc_bias_m_s2=0.0))
    z = [sensors.read(step, truth())[-1].zacc + 9.80665 for step in range(1, 2001)]
    assert np.std(z) == pytest.approx(0.05, rel=0.1)
    assert abs(np.mean(z)) < 0.006


def test_no_sensor_repeats_itself_so_long_that_px4_takes_it_for_stuck() -> None:
    sensors = HilSensors(1)
    last = [sensors.read(step, truth())[-1] for step in range(5, 600, 5)]
    for name in ("xacc", "xgyro", "xmag", "ymag", "zmag", "abs_pressure"):
        assert len({getattr(message, name) for message in last}) > 0.9 * len(last)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_same_seed_gives_the_same_readings(seed: int) -> None:
    first, again = read(SensorNoise(), seed), read(SensorNoise(), seed)
    assert [m.to_dict() for m in first] == [m.to_dict() for m in again]


def test_another_seed_gives_other_readings() -> None:
    assert read(SensorNoise(), 1)[1].xacc != read(SensorNoise(), 2)[1].xacc
