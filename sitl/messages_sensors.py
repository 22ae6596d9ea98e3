"""What do the sensors, the outputs and the clock say right now? One builder a message id; pure.

Sensors here are without error: what a client reads for display. The estimate is in ``messages``.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import rotation_ned_frd
from companion.core.types import F64
from sitl.aircraft import GRAVITY_M_S2
from sitl.hil_sensors import LAPSE_K_M, SEA_LEVEL_K, ZERO_C_K, field_ned_gauss, pressure_at
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

FIELD_NED_GAUSS: Final = field_ned_gauss()
ALL_FIELDS: Final = 0x1FFF  # HIGHRES_IMU
PWM_OFF, PWM_MIN, PWM_MAX = 900, 1000, 2000  # PX4's SITL outputs
UNKNOWN_VARIANCE_CM2: Final = 255  # DISTANCE_SENSOR
GOOD_SIGNAL, INVALID_SIGNAL = 100, 1
UNKNOWN_COVARIANCE: Final = [math.nan] * 21
NO_VARIANCE: Final = 0.01  # assumed: of an estimate that is the truth
ESTIMATOR_AUTOPILOT: Final = 8  # MAV_ESTIMATOR_TYPE_AUTOPILOT


def highres_imu(sim: Simulation) -> Message:
    """HIGHRES_IMU; pressure in Pa, as PX4 v1.16 sends it."""
    alt_m = _baro_alt_m(sim)
    acc_frd_m_s2, rates_frd_rad_s = sim.trouble.felt(sim.truth)
    return mav.MAVLink_highres_imu_message(
        codec.to_us(sim.truth.t_s),
        *acc_frd_m_s2.tolist(),
        *rates_frd_rad_s.tolist(),
        *_field_frd_gauss(sim).tolist(),
        pressure_at(alt_m) * 100.0,
        0.0,
        alt_m,
        _temperature_c(alt_m),
        ALL_FIELDS,
    )


def scaled_imu(sim: Simulation) -> Message:
    """SCALED_IMU."""
    return mav.MAVLink_scaled_imu_message(codec.to_ms(sim.truth.t_s), *_imu_units(sim))


def raw_imu(sim: Simulation) -> Message:
    """RAW_IMU, in the units of SCALED_IMU."""
    return mav.MAVLink_raw_imu_message(codec.to_us(sim.truth.t_s), *_imu_units(sim))


def scaled_pressure(sim: Simulation) -> Message:
    """SCALED_PRESSURE."""
    alt_m = _baro_alt_m(sim)
    return mav.MAVLink_scaled_pressure_message(
        codec.to_ms(sim.truth.t_s), pressure_at(alt_m), 0.0, round(_temperature_c(alt_m) * 100)
    )


def distance_sensor(sim: Simulation) -> Message | None:
    """DISTANCE_SENSOR: what the LiDAR sees ahead of the nose; None before the first scan."""
    scan = sim.scan
    if scan is None:
        return None
    range_m = float(scan.range_m[round(-scan.angle_offset_rad / scan.increment_rad) % len(scan.range_m)])
    max_cm = round(scan.range_max_m * 100)
    return mav.MAVLink_distance_sensor_message(
        codec.to_ms(scan.t_s),
        round(scan.range_min_m * 100),
        max_cm,
        round(range_m * 100) if math.isfinite(range_m) else max_cm + 1,
        mav.MAV_DISTANCE_SENSOR_LASER,
        0,
        mav.MAV_SENSOR_ROTATION_NONE,
        UNKNOWN_VARIANCE_CM2,
        scan.increment_rad,
        scan.increment_rad,
        signal_quality=GOOD_SIGNAL if math.isfinite(range_m) else INVALID_SIGNAL,
    )


def vibration(sim: Simulation) -> Message:
    """VIBRATION: none."""
    return mav.MAVLink_vibration_message(codec.to_us(sim.t_s), 0.0, 0.0, 0.0, 0, 0, 0)


def odometry(sim: Simulation) -> Message:
    """ODOMETRY in local ned, velocity too."""
    state = sim.state
    return mav.MAVLink_odometry_message(
        codec.to_us(state.t_s),
        mav.MAV_FRAME_LOCAL_NED,
        mav.MAV_FRAME_LOCAL_NED,
        *state.pos_ned_m.tolist(),
        state.q_ned_frd.tolist(),
        *state.vel_ned_m_s.tolist(),
        *state.rates_frd_rad_s.tolist(),
        UNKNOWN_COVARIANCE,
        UNKNOWN_COVARIANCE,
        0,
        ESTIMATOR_AUTOPILOT,
        100,
    )


def servo_output_raw(sim: Simulation) -> Message:
    """SERVO_OUTPUT_RAW: the four motors."""
    span = PWM_MAX - PWM_MIN
    on = sim.autopilot.motors_on
    pwm = [round(PWM_MIN + span * min(1.0, max(0.0, r))) if on else PWM_OFF for r in sim.loops.rotors_norm]
    return mav.MAVLink_servo_output_raw_message(codec.to_us(sim.t_s) & 0xFFFFFFFF, 0, *pwm, 0, 0, 0, 0)


def actuator_output_status(sim: Simulation) -> Message:
    """ACTUATOR_OUTPUT_STATUS: the four motors, 0 to 1."""
    rotors = list(sim.loops.rotors_norm)
    return mav.MAVLink_actuator_output_status_message(
        codec.to_us(sim.t_s), (1 << len(rotors)) - 1, rotors + [0.0] * (32 - len(rotors))
    )


def hil_state_quaternion(sim: Simulation) -> Message:
    """HIL_STATE_QUATERNION: the truth."""
    truth = sim.truth
    north_m, east_m, down_m = truth.pos_ned_m.tolist()
    lat_deg, lon_deg = sim.origin.lat_lon_deg(north_m, east_m)
    speed_cm_s = round(float(np.linalg.norm(truth.vel_ned_m_s)) * 1e2)
    return mav.MAVLink_hil_state_quaternion_message(
        codec.to_us(truth.t_s),
        truth.q_ned_frd.tolist(),
        *truth.rates_frd_rad_s.tolist(),
        round(lat_deg * 1e7),
        round(lon_deg * 1e7),
        round(sim.origin.alt_m(down_m) * 1e3),
        *(_int16(v * 1e2) for v in truth.vel_ned_m_s.tolist()),
        min(speed_cm_s, 0xFFFF),
        min(speed_cm_s, 0xFFFF),
        *(_int16(a / GRAVITY_M_S2 * 1e3) for a in truth.acc_frd_m_s2.tolist()),
    )


def wind_cov(sim: Simulation) -> Message:
    """WIND_COV: the mean wind."""
    wind = sim.config.wind
    north, east, down = wind.mean_ned_m_s if wind is not None else (0.0, 0.0, 0.0)
    alt_m = sim.origin.alt_m(float(sim.state.pos_ned_m[2]))
    return mav.MAVLink_wind_cov_message(
        codec.to_us(sim.t_s), north, east, down, NO_VARIANCE, NO_VARIANCE, alt_m, NO_VARIANCE, NO_VARIANCE
    )


def system_time(sim: Simulation) -> Message:
    """SYSTEM_TIME: UNIX time of the boot and vehicle time since."""
    return mav.MAVLink_system_time_message(sim.boot_unix_us + codec.to_us(sim.t_s), sim.t_ms)


def timesync(sim: Simulation) -> Message:
    """TIMESYNC: asks the other side for its time."""
    return mav.MAVLink_timesync_message(0, sim.t_ms * 1_000_000)


def ping(sim: Simulation) -> Message:
    """PING to everybody."""
    return mav.MAVLink_ping_message(codec.to_us(sim.t_s), sim.t_ms // 1000 & 0xFFFFFFFF, 0, 0)


BUILDERS: Final[Mapping[int, Callable[[Simulation], Message | None]]] = {
    mav.MAVLINK_MSG_ID_HIGHRES_IMU: highres_imu,
    mav.MAVLINK_MSG_ID_SCALED_IMU: scaled_imu,
    mav.MAVLINK_MSG_ID_RAW_IMU: raw_imu,
    mav.MAVLINK_MSG_ID_SCALED_PRESSURE: scaled_pressure,
    mav.MAVLINK_MSG_ID_DISTANCE_SENSOR: distance_sensor,
    mav.MAVLINK_MSG_ID_VIBRATION: vibration,
    mav.MAVLINK_MSG_ID_ODOMETRY: odometry,
    mav.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: servo_output_raw,
    mav.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: actuator_output_status,
    mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: hil_state_quaternion,
    mav.MAVLINK_MSG_ID_WIND_COV: wind_cov,
    mav.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mav.MAVLINK_MSG_ID_TIMESYNC: timesync,
    mav.MAVLINK_MSG_ID_PING: ping,
}


def _field_frd_gauss(sim: Simulation) -> F64:
    field: F64 = rotation_ned_frd(sim.truth.q_ned_frd).T @ FIELD_NED_GAUSS
    return field


def _baro_alt_m(sim: Simulation) -> float:
    return sim.origin.alt_m(float(sim.truth.pos_ned_m[2] + sim.trouble.errors.pos_ned_m[2]))


def _imu_units(sim: Simulation) -> list[int]:
    """Milli-g, mrad/s, mgauss."""
    acc_frd_m_s2, rates_frd_rad_s = sim.trouble.felt(sim.truth)
    scaled = (acc_frd_m_s2 / GRAVITY_M_S2, rates_frd_rad_s, _field_frd_gauss(sim))
    return [_int16(value * 1e3) for vector in scaled for value in vector.tolist()]


def _temperature_c(alt_m: float) -> float:
    return SEA_LEVEL_K - LAPSE_K_M * alt_m - ZERO_C_K


def _int16(value: float) -> int:
    return max(-32767, min(32767, round(value)))
