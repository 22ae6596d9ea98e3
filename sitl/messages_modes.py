"""What does the vehicle say about what it is doing and asked to do? One builder a message id; pure."""

import math
import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import quaternion, yaw_rad
from companion.core.types import F64
from sitl.demand import Demand, Loop
from sitl.extra_messages import RawMessage, protocol_version
from sitl.modes import TITLES, FlightMode
from sitl.simulation import Simulation
from sitl.streams import CURRENT_MODE_ID

Message = Any  # a MAVLink_*_message object

IGNORE_RATES: Final = 7  # ATTITUDE_TARGET_TYPEMASK
IGNORE_ATTITUDE: Final = 128
AVAILABLE_MODES_ID, PROTOCOL_VERSION_ID = 435, 300
_CURRENT_MODE = struct.Struct("<IIB")
_AVAILABLE_MODE = struct.Struct("<IIBBB35s")
ADVANCED: Final = 1  # MAV_MODE_PROPERTY
NOT_SELECTABLE: Final = 2

# MAV_STANDARD_MODE of those modes that have one.
STANDARD: Final = {
    FlightMode.POSCTL: 1,
    FlightMode.ORBIT: 2,
    FlightMode.ALTCTL: 4,
    FlightMode.RTL: 5,
    FlightMode.MISSION: 6,
    FlightMode.LAND: 7,
    FlightMode.TAKEOFF: 8,
}
HIDDEN: Final = {FlightMode.TERMINATION, FlightMode.ORBIT}
EXPERT: Final = {FlightMode.ACRO, FlightMode.OFFBOARD, FlightMode.POSITION_SLOW}


def position_target_local_ned(sim: Simulation) -> Message | None:
    """POSITION_TARGET_LOCAL_NED of the position loop; None while it does not act."""
    demand = sim.autopilot.demand
    if demand.loop is not Loop.POSITION:
        return None
    vectors = (demand.pos_ned_m, demand.vel_ned_m_s, demand.acc_ned_m_s2)
    return mav.MAVLink_position_target_local_ned_message(
        sim.t_ms,
        mav.MAV_FRAME_LOCAL_NED,
        _mask(demand),
        *(value for vector in vectors for value in vector.tolist()),
        demand.yaw_rad,
        demand.yaw_rate_rad_s,
    )


def attitude_target(sim: Simulation) -> Message | None:
    """ATTITUDE_TARGET: attitude, body rates and thrust that the loops hold; None while none acts."""
    demand, loops = sim.autopilot.demand, sim.loops
    if demand.loop is Loop.IDLE:
        return None
    mask = IGNORE_ATTITUDE if demand.loop is Loop.RATES else 0
    heading = demand.yaw_rad if math.isfinite(demand.yaw_rad) else yaw_rad(sim.state.q_ned_frd)
    q = demand.q_ned_frd if demand.q_ned_frd is not None else _attitude(loops.z_ned, heading)
    return mav.MAVLink_attitude_target_message(
        sim.t_ms, mask, q.tolist(), *loops.rates_frd_rad_s.tolist(), loops.thrust_norm
    )


def orbit_execution_status(sim: Simulation) -> Message | None:
    """ORBIT_EXECUTION_STATUS; None in every other mode."""
    circle = sim.autopilot.steering.circle
    if circle is None or sim.autopilot.mode is not FlightMode.ORBIT:
        return None
    north_m, east_m, down_m = circle.centre_ned_m.tolist()
    lat_deg, lon_deg = sim.origin.lat_lon_deg(north_m, east_m)
    return mav.MAVLink_orbit_execution_status_message(
        codec.to_us(sim.t_s),
        math.copysign(circle.radius_m, circle.speed_m_s),
        mav.MAV_FRAME_GLOBAL,
        round(lat_deg * 1e7),
        round(lon_deg * 1e7),
        sim.origin.alt_m(down_m),
    )


def flight_information(sim: Simulation) -> Message:
    """FLIGHT_INFORMATION: when the vehicle was armed and took off last, UNIX time; 0: never."""
    ap = sim.autopilot
    armed, flying = (sim.boot_unix_us + codec.to_us(t) if math.isfinite(t) else 0 for t in (ap.armed_s, ap.takeoff_s))
    return mav.MAVLink_flight_information_message(sim.t_ms, armed, flying, ap.flights)


def current_mode(sim: Simulation) -> Message:
    """CURRENT_MODE: the mode flown and the one asked for."""
    mode, wanted = sim.autopilot.mode, sim.autopilot.user_mode
    return RawMessage(CURRENT_MODE_ID, "CURRENT_MODE", 193, _CURRENT_MODE.pack(mode, wanted, STANDARD.get(mode, 0)))


def available_modes(number: int) -> list[Message]:
    """AVAILABLE_MODES: the mode with this number from 1 on, or with 0 all of them; empty for a wrong number."""
    modes = list(TITLES)
    wanted = range(1, len(modes) + 1) if number == 0 else [number]
    return [_available(i, modes) for i in wanted if 1 <= i <= len(modes)]


def version_of_protocol(_sim: Simulation) -> Message:
    """PROTOCOL_VERSION."""
    return protocol_version()


BUILDERS: Final[Mapping[int, Callable[[Simulation], Message | None]]] = {
    mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: position_target_local_ned,
    mav.MAVLINK_MSG_ID_ATTITUDE_TARGET: attitude_target,
    mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: orbit_execution_status,
    mav.MAVLINK_MSG_ID_FLIGHT_INFORMATION: flight_information,
    CURRENT_MODE_ID: current_mode,
    PROTOCOL_VERSION_ID: version_of_protocol,
}


def _available(number: int, modes: list[FlightMode]) -> Message:
    mode = modes[number - 1]
    standard = STANDARD.get(mode, 0)
    properties = (ADVANCED if mode in EXPERT else 0) | (NOT_SELECTABLE if mode in HIDDEN else 0)
    name = b"" if standard else TITLES[mode].encode()
    body = _AVAILABLE_MODE.pack(mode, properties, len(modes), number, standard, name)
    return RawMessage(AVAILABLE_MODES_ID, "AVAILABLE_MODES", 134, body)


def _mask(demand: Demand) -> int:
    """Bits of what is absent."""
    values = (*demand.pos_ned_m.tolist(), *demand.vel_ned_m_s.tolist(), *demand.acc_ned_m_s2.tolist())
    mask = sum(1 << i for i, value in enumerate(values) if math.isnan(value))
    return mask | (codec.MASK_YAW if math.isnan(demand.yaw_rad) else 0)


def _attitude(z_ned: F64, heading_rad: float) -> F64:
    """Attitude (4,) with this down axis and heading."""
    north, east, down = (z_ned / max(float(np.linalg.norm(z_ned)), 1e-9)).tolist()
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    ahead, right = cos * north + sin * east, cos * east - sin * north
    return quaternion(math.atan2(-right, math.hypot(ahead, down)), math.atan2(ahead, down), heading_rad)
