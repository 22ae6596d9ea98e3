"""What does each message of the vehicle say right now? One builder a message id; pure."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import euler_rad
from sitl.modes import base_mode
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object


# SYS_STATUS of a ready PX4 v1.16 (measured), with the geofence reported healthy: MAVProxy calls it breached otherwise.
PRESENT: Final = 0x0300402F
ENABLED: Final = 0x0301402F
HEALTHY: Final = 0x1330C83F
PREARM: Final = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK

CAPABILITIES: Final = 0xE8FF  # PX4's own
FLIGHT_VERSION: Final = 1 << 24 | 16 << 16 | 255  # 1.16.0 release: the version whose behaviour this follows
PX4_VENDOR: Final = 0x26AC
SENSOR_BITS: Final[Mapping[int, tuple[str, ...]]] = {  # MAV_SYS_STATUS_SENSOR, and the faults that clear it
    mav.MAV_SYS_STATUS_SENSOR_3D_GYRO: ("gyro_off",),
    mav.MAV_SYS_STATUS_SENSOR_3D_ACCEL: ("accel_off",),
    mav.MAV_SYS_STATUS_SENSOR_3D_MAG: ("mag_off",),
    mav.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: ("baro_off",),
    mav.MAV_SYS_STATUS_SENSOR_GPS: ("gps_off", "gps_stuck"),
}
CELLS: Final = 4
CELL_FULL_V: Final = 4.2
CELL_EMPTY_V: Final = 3.5
NO_CELL: Final = 65535
ESTIMATOR_OK: Final = 831  # ESTIMATOR_STATUS.flags of a good estimate with GPS


def heartbeat(sim: Simulation) -> Message:
    """HEARTBEAT."""
    ap = sim.autopilot
    if ap.failsafe is not None:
        status = mav.MAV_STATE_CRITICAL
    elif ap.armed:
        status = mav.MAV_STATE_ACTIVE
    else:
        status = mav.MAV_STATE_STANDBY if ap.ready else mav.MAV_STATE_UNINIT
    return codec.encode_vehicle_heartbeat(base_mode(ap.mode, ap.armed), int(ap.mode), status)


def extended_sys_state(sim: Simulation) -> Message:
    """EXTENDED_SYS_STATE."""
    return codec.encode_extended_state(sim.autopilot.landed_state)


def attitude_quaternion(sim: Simulation) -> Message:
    """ATTITUDE_QUATERNION."""
    return codec.encode_attitude(sim.state)


def local_position_ned(sim: Simulation) -> Message:
    """LOCAL_POSITION_NED."""
    return codec.encode_position(sim.state)


def obstacle_distance(sim: Simulation) -> Message | None:
    """OBSTACLE_DISTANCE of the last scan; None before the first."""
    return codec.encode_scan(sim.scan) if sim.scan is not None else None


def attitude(sim: Simulation) -> Message:
    """ATTITUDE."""
    state = sim.state
    return mav.MAVLink_attitude_message(
        codec.to_ms(state.t_s), *euler_rad(state.q_ned_frd), *state.rates_frd_rad_s.tolist()
    )


def global_position_int(sim: Simulation) -> Message:
    """GLOBAL_POSITION_INT."""
    state = sim.state
    north_m, east_m, down_m = state.pos_ned_m.tolist()
    lat_deg, lon_deg = sim.origin.lat_lon_deg(north_m, east_m)
    return mav.MAVLink_global_position_int_message(
        codec.to_ms(state.t_s),
        _e7(lat_deg),
        _e7(lon_deg),
        round(sim.origin.alt_m(down_m) * 1e3),
        round((_home_down_m(sim) - down_m) * 1e3),
        *(_clip16(v * 1e2) for v in state.vel_ned_m_s.tolist()),
        _heading_cdeg(sim),
    )


def gps_raw_int(sim: Simulation) -> Message:
    """GPS_RAW_INT of a receiver without error."""
    state = sim.state
    north_m, east_m, down_m = state.pos_ned_m.tolist()
    lat_deg, lon_deg = sim.origin.lat_lon_deg(north_m, east_m)
    north_m_s, east_m_s, _ = state.vel_ned_m_s.tolist()
    course_rad = math.atan2(east_m_s, north_m_s) % math.tau
    return mav.MAVLink_gps_raw_int_message(
        time_usec=codec.to_us(state.t_s),
        fix_type=mav.GPS_FIX_TYPE_3D_FIX if sim.trouble.errors.gps_ok else mav.GPS_FIX_TYPE_NO_FIX,
        lat=_e7(lat_deg),
        lon=_e7(lon_deg),
        alt=round(sim.origin.alt_m(down_m) * 1e3),
        eph=70,  # HDOP and VDOP of a good receiver, times 100
        epv=110,
        vel=round(math.hypot(north_m_s, east_m_s) * 1e2),
        cog=round(math.degrees(course_rad) * 1e2) % 36000,
        satellites_visible=16 if sim.trouble.errors.gps_ok else 0,
    )


def sys_status(sim: Simulation) -> Message:
    """SYS_STATUS: health bits and battery."""
    health = (HEALTHY if sim.autopilot.ready else HEALTHY & ~PREARM) & ~_unhealthy(sim)
    return mav.MAVLink_sys_status_message(
        PRESENT,
        ENABLED,
        health,
        load=300,
        voltage_battery=round(_cell_v(sim) * CELLS * 1e3),
        current_battery=-1,
        battery_remaining=_battery_percent(sim),
        drop_rate_comm=0,
        errors_comm=0,
        errors_count1=0,
        errors_count2=0,
        errors_count3=0,
        errors_count4=0,
    )


def battery_status(sim: Simulation) -> Message:
    """BATTERY_STATUS: four equal cells that last as long as the data sheet says."""
    cells = [round(_cell_v(sim) * 1e3)] * CELLS + [NO_CELL] * (10 - CELLS)
    return mav.MAVLink_battery_status_message(
        id=0,
        battery_function=mav.MAV_BATTERY_FUNCTION_ALL,
        type=mav.MAV_BATTERY_TYPE_LIPO,
        temperature=32767,
        voltages=cells,
        current_battery=-1,
        current_consumed=-1,
        energy_consumed=-1,
        battery_remaining=_battery_percent(sim),
    )


def home_position(sim: Simulation) -> Message | None:
    """HOME_POSITION; None until the vehicle knows where it is."""
    home = sim.autopilot.home
    if home is None:
        return None
    q = [math.cos(home.yaw_rad / 2), 0.0, 0.0, math.sin(home.yaw_rad / 2)]
    north_m, east_m, down_m = home.pos_ned_m.tolist()
    lat_deg, lon_deg = sim.origin.lat_lon_deg(north_m, east_m)
    return mav.MAVLink_home_position_message(
        _e7(lat_deg),
        _e7(lon_deg),
        round(sim.origin.alt_m(down_m) * 1e3),
        north_m,
        east_m,
        down_m,
        q,
        math.nan,
        math.nan,
        math.nan,
        codec.to_us(sim.t_s),
    )


def altitude(sim: Simulation) -> Message:
    """ALTITUDE."""
    down_m = float(sim.state.pos_ned_m[2])
    amsl_m = sim.origin.alt_m(down_m)
    return mav.MAVLink_altitude_message(
        codec.to_us(sim.state.t_s), amsl_m, amsl_m, -down_m, _home_down_m(sim) - down_m, math.nan, math.nan
    )


def vfr_hud(sim: Simulation) -> Message:
    """VFR_HUD."""
    state = sim.state
    north_m_s, east_m_s, down_m_s = state.vel_ned_m_s.tolist()
    ground_m_s = math.hypot(north_m_s, east_m_s)
    throttle = round(100 * min(1.0, max(0.0, sim.truth.thrust_norm)))
    alt_m = sim.origin.alt_m(float(state.pos_ned_m[2]))
    return mav.MAVLink_vfr_hud_message(ground_m_s, ground_m_s, _heading_cdeg(sim) // 100, throttle, alt_m, -down_m_s)


def estimator_status(sim: Simulation) -> Message:
    """ESTIMATOR_STATUS: no errors are admitted, only whether there is a position."""
    flags = ESTIMATOR_OK if sim.autopilot.ready and sim.trouble.errors.position_ok else 0
    return mav.MAVLink_estimator_status_message(codec.to_us(sim.t_s), flags, *[0.0] * 8)


def gps_global_origin(sim: Simulation) -> Message:
    """GPS_GLOBAL_ORIGIN."""
    lat, lon, alt = _e7(sim.origin.lat_deg), _e7(sim.origin.lon_deg), round(sim.origin.alt_amsl_m * 1e3)
    return mav.MAVLink_gps_global_origin_message(lat, lon, alt, codec.to_us(sim.t_s))


def autopilot_version(_sim: Simulation) -> Message:
    """AUTOPILOT_VERSION."""
    return mav.MAVLink_autopilot_version_message(
        CAPABILITIES, FLIGHT_VERSION, FLIGHT_VERSION, FLIGHT_VERSION, 0, [0] * 8, [0] * 8, [0] * 8, PX4_VENDOR, 0, 1
    )


def status_texts(severity: int, text: str, number: int) -> list[Message]:
    """STATUSTEXT of one text: chunks of 50 bytes under ``number`` when it is longer than one."""
    raw = text.encode()
    if len(raw) <= 50:
        return [mav.MAVLink_statustext_message(severity, raw)]
    ends = range(0, len(raw) + 1, 50)  # a full last chunk is followed by an empty one
    return [mav.MAVLink_statustext_message(severity, raw[at : at + 50], number, i) for i, at in enumerate(ends)]


BUILDERS: Final[Mapping[int, Callable[[Simulation], Message | None]]] = {
    mav.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mav.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    mav.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    mav.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mav.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mav.MAVLINK_MSG_ID_ALTITUDE: altitude,
    mav.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_status,
    mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: obstacle_distance,
    mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
}


def _unhealthy(sim: Simulation) -> int:
    """SYS_STATUS bits of the sensors that have failed, and of a breached geofence."""
    bits = sum(bit for bit, names in SENSOR_BITS.items() if any(name in sim.trouble.active for name in names))
    return bits | (mav.MAV_SYS_STATUS_GEOFENCE if sim.autopilot.guardian.breach is not None else 0)


def _battery_percent(sim: Simulation) -> int:
    return round(100 * sim.trouble.battery.remaining)


def _cell_v(sim: Simulation) -> float:
    return CELL_EMPTY_V + (CELL_FULL_V - CELL_EMPTY_V) * _battery_percent(sim) / 100


def _home_down_m(sim: Simulation) -> float:
    home = sim.autopilot.home
    return home.down_m if home is not None else 0.0


def _heading_cdeg(sim: Simulation) -> int:
    return round(math.degrees(euler_rad(sim.state.q_ned_frd)[2]) * 1e2) % 36000


def _e7(angle_deg: float) -> int:
    return round(angle_deg * 1e7)


def _clip16(value: float) -> int:
    return max(-32767, min(32767, round(value)))
