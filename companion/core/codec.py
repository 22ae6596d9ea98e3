"""How do our values look as MAVLink messages? Pure; the only place where centimetres, degrees and bitmasks live.

``encode_*`` builds message objects of pymavlink's ``common`` dialect, ``decode_*`` reads them, and ``quantise_*`` gives
what would arrive on the other end (float32, cm, ms) without making bytes, so that a run in one process sees exactly
what a run over sockets sees. Times are vehicle time since boot. Local ned, body frd.
"""

import math
import struct
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.sectors import SECTORS, bin_scan
from companion.core.types import F64, AutopilotStatus, LandedState, Scan, Setpoint, VehicleState

Message = Any  # pymavlink is untyped: a MAVLink_*_message object

VEHICLE_SYSTEM: Final = 1
VEHICLE_COMPONENT: Final = mav.MAV_COMP_ID_AUTOPILOT1
COMPANION_COMPONENT: Final = mav.MAV_COMP_ID_ONBOARD_COMPUTER

# PX4_CUSTOM_MAIN_MODE_*, PX4_CUSTOM_SUB_MODE_*; custom_mode of HEARTBEAT is main << 16 | sub << 24.
PX4_MAIN_AUTO: Final = 4
PX4_MAIN_OFFBOARD: Final = 6
PX4_SUB_LOITER: Final = 3
PX4_OFFBOARD: Final = PX4_MAIN_OFFBOARD << 16
PX4_HOLD: Final = PX4_MAIN_AUTO << 16 | PX4_SUB_LOITER << 24

STATUSTEXT_CHARS: Final = 50

UNKNOWN_CM: Final = 65535  # "unknown / not used"
RANGE_MAX_CM: Final = 65533  # leaves max + 1 = "no obstacle" below UNKNOWN_CM

# POSITION_TARGET_TYPEMASK: a set bit takes the field out.
MASK_POS: Final = (1, 2, 4)
MASK_VEL: Final = (8, 16, 32)
MASK_ACC: Final = (64, 128, 256)
MASK_FORCE: Final = 512  # read the acceleration fields as a force
MASK_YAW: Final = 1024
MASK_YAW_RATE: Final = 2048

_STATE_F32 = struct.Struct("<13f")
_SETPOINT_F32 = struct.Struct("<10f")
_SCAN_F32 = struct.Struct("<2f")
_NO_PART: Final = (0.0, 0.0, 0.0)


class CodecError(ValueError):
    """A message cannot be read as the value asked for; the text says why."""


# --- time ---------------------------------------------------------------------------------------------------------


def to_ms(t_s: float) -> int:
    """Vehicle time as time_boot_ms."""
    return round(t_s * 1e3)


def to_us(t_s: float) -> int:
    """Vehicle time as time_usec."""
    return round(t_s * 1e6)


def from_ms(time_boot_ms: int) -> float:
    """Seconds of a time_boot_ms; the same double that ``from_us`` gives for the same instant."""
    return time_boot_ms / 1e3


def from_us(time_usec: int) -> float:
    """Seconds of a time_usec."""
    return time_usec / 1e6


# --- vehicle state ------------------------------------------------------------------------------------------------


def encode_attitude(state: VehicleState) -> Message:
    """ATTITUDE_QUATERNION of a state."""
    return mav.MAVLink_attitude_quaternion_message(
        to_ms(state.t_s), *state.q_ned_frd.tolist(), *state.rates_frd_rad_s.tolist()
    )


def encode_position(state: VehicleState) -> Message:
    """LOCAL_POSITION_NED of a state."""
    return mav.MAVLink_local_position_ned_message(
        to_ms(state.t_s), *state.pos_ned_m.tolist(), *state.vel_ned_m_s.tolist()
    )


def decode_state(attitude: Message, position: Message) -> VehicleState:
    """The state that an ATTITUDE_QUATERNION and a LOCAL_POSITION_NED of the same instant carry."""
    return VehicleState(
        t_s=from_ms(position.time_boot_ms),
        pos_ned_m=np.array((position.x, position.y, position.z)),
        vel_ned_m_s=np.array((position.vx, position.vy, position.vz)),
        q_ned_frd=np.array((attitude.q1, attitude.q2, attitude.q3, attitude.q4)),
        rates_frd_rad_s=np.array((attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)),
    )


def quantise_state(state: VehicleState) -> VehicleState:
    """The state as the wire would deliver it: float32, whole milliseconds."""
    wire = _STATE_F32.pack(
        *state.pos_ned_m.tolist(),
        *state.vel_ned_m_s.tolist(),
        *state.q_ned_frd.tolist(),
        *state.rates_frd_rad_s.tolist(),
    )
    values = np.frombuffer(wire, dtype="<f4").astype(np.float64)
    return VehicleState(from_ms(to_ms(state.t_s)), values[0:3], values[3:6], values[6:10], values[10:13])


# --- autopilot status ---------------------------------------------------------------------------------------------


def encode_vehicle_heartbeat(base_mode: int, custom_mode: int, system_status: int) -> Message:
    """HEARTBEAT of a PX4 quadrotor."""
    return mav.MAVLink_heartbeat_message(
        mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4, base_mode, custom_mode, system_status, 3
    )


def encode_companion_heartbeat() -> Message:
    """HEARTBEAT of the companion: no autopilot, custom mode flag clear, so that nobody takes it for the vehicle."""
    return mav.MAVLink_heartbeat_message(
        mav.MAV_TYPE_ONBOARD_CONTROLLER, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3
    )


def encode_extended_state(landed: LandedState) -> Message:
    """EXTENDED_SYS_STATE of a vehicle that is no VTOL."""
    return mav.MAVLink_extended_sys_state_message(mav.MAV_VTOL_STATE_UNDEFINED, int(landed))


def decode_status(heartbeat: Message, extended: Message | None) -> AutopilotStatus:
    """What HEARTBEAT and EXTENDED_SYS_STATE say together; landed is UNDEFINED until the latter was heard."""
    custom = bool(heartbeat.base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
    return AutopilotStatus(
        armed=bool(heartbeat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED),
        offboard=custom and (heartbeat.custom_mode >> 16) & 0xFF == PX4_MAIN_OFFBOARD,
        landed=decode_landed(extended) if extended is not None else LandedState.UNDEFINED,
    )


def decode_landed(extended: Message) -> LandedState:
    """landed_state of an EXTENDED_SYS_STATE; a value that MAVLink does not know is UNDEFINED."""
    try:
        return LandedState(extended.landed_state)
    except ValueError:
        return LandedState.UNDEFINED


# --- requests and texts -------------------------------------------------------------------------------------------


def encode_set_mode(custom_mode: int, target_system: int) -> Message:
    """COMMAND_LONG DO_SET_MODE for a PX4 ``custom_mode``."""
    flag = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    main_mode, sub_mode = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    return mav.MAVLink_command_long_message(
        target_system, VEHICLE_COMPONENT, mav.MAV_CMD_DO_SET_MODE, 0, flag, main_mode, sub_mode, 0, 0, 0, 0
    )


def encode_text(text: str, severity: int = mav.MAV_SEVERITY_WARNING) -> Message:
    """STATUSTEXT; what is longer than 50 characters is cut off."""
    return mav.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:STATUSTEXT_CHARS])


# --- scan ---------------------------------------------------------------------------------------------------------


def encode_scan(scan: Scan) -> Message:
    """OBSTACLE_DISTANCE (BODY_FRD) of a scan of any number of sectors; more than 72 become 72 sector minima."""
    scan = bin_scan(scan)
    max_cm = _max_cm(scan)
    distances = [UNKNOWN_CM] * SECTORS
    distances[: len(scan.range_m)] = _wire_cm(scan.range_m, max_cm).astype(np.int64).tolist()
    increment_deg = math.degrees(scan.increment_rad)
    return mav.MAVLink_obstacle_distance_message(
        time_usec=to_us(scan.t_s),
        sensor_type=mav.MAV_DISTANCE_SENSOR_LASER,
        distances=distances,
        increment=min(255, round(increment_deg)),
        min_distance=round(scan.range_min_m * 1e2),
        max_distance=max_cm,
        increment_f=increment_deg,
        angle_offset=math.degrees(scan.angle_offset_rad),
        frame=mav.MAV_FRAME_BODY_FRD,
    )


def decode_scan(message: Message, yaw_rad: float = 0.0) -> Scan:
    """The scan of an OBSTACLE_DISTANCE; ``yaw_rad`` turns a north-aligned one (frame 0) into the body frame.

    Raises CodecError for other frames and for an increment of zero.
    """
    increment_deg = message.increment_f if message.increment_f else float(message.increment)
    if not math.isfinite(increment_deg) or increment_deg == 0.0 or not math.isfinite(message.angle_offset):
        raise CodecError(f"OBSTACLE_DISTANCE with increment {increment_deg} and offset {message.angle_offset} degrees")
    offset_rad = math.radians(message.angle_offset)
    if message.frame == mav.MAV_FRAME_GLOBAL:
        offset_rad -= yaw_rad
    elif message.frame != mav.MAV_FRAME_BODY_FRD:
        raise CodecError(f"OBSTACLE_DISTANCE in frame {message.frame}; GLOBAL (0) and BODY_FRD (12) are understood")
    count = _sector_count(abs(increment_deg))
    range_m = _metres(np.array(message.distances[:count], dtype=np.float64), message.max_distance)
    if increment_deg < 0.0:  # counted counter-clockwise
        offset_rad += math.radians((count - 1) * increment_deg)
        range_m = range_m[::-1]
    return Scan(
        t_s=from_us(message.time_usec),
        range_m=range_m,
        angle_offset_rad=offset_rad,
        increment_rad=math.radians(abs(increment_deg)),
        range_min_m=message.min_distance / 1e2,
        range_max_m=message.max_distance / 1e2,
    )


def quantise_scan(scan: Scan) -> Scan:
    """The scan as the wire would deliver it: at most 72 sectors, cm, float32 degrees, whole microseconds."""
    scan = bin_scan(scan)
    max_cm = _max_cm(scan)
    wire = _SCAN_F32.pack(math.degrees(scan.increment_rad), math.degrees(scan.angle_offset_rad))
    increment_deg, offset_deg = _SCAN_F32.unpack(wire)
    count = _sector_count(increment_deg)
    range_m = _whole_cm_m(scan.range_m, max_cm)
    if len(range_m) != count:
        padded = np.full(count, math.nan)
        padded[: len(range_m)] = range_m[:count]
        range_m = padded
    return Scan(
        t_s=from_us(to_us(scan.t_s)),
        range_m=range_m,
        angle_offset_rad=math.radians(offset_deg),
        increment_rad=math.radians(increment_deg),
        range_min_m=round(scan.range_min_m * 1e2) / 1e2,
        range_max_m=max_cm / 1e2,
    )


def _max_cm(scan: Scan) -> int:
    return min(RANGE_MAX_CM, round(scan.range_max_m * 1e2))


def _sector_count(increment_deg: float) -> int:
    """Sectors in use: what fits into one turn, at most 72."""
    return min(SECTORS, max(1, math.floor(360.0 / increment_deg + 1e-3)))


def _wire_cm(range_m: F64, max_cm: int) -> F64:
    """Ranges as the integers of the wire, still as floats: hit, max + 1 for free, 65535 for unknown."""
    wire_cm = np.rint(range_m * 1e2)
    np.minimum(wire_cm, max_cm, out=wire_cm)
    np.maximum(wire_cm, 0.0, out=wire_cm)
    wire_cm[np.isinf(range_m)] = max_cm + 1
    wire_cm[np.isnan(range_m)] = UNKNOWN_CM
    return wire_cm


def _whole_cm_m(range_m: F64, max_cm: int) -> F64:
    """``_metres`` of ``_wire_cm`` in fewer steps: free stays inf, unknown NaN."""
    whole_m: F64 = np.rint(range_m * 1e2)
    np.minimum(whole_m, max_cm, out=whole_m)
    np.maximum(whole_m, 0.0, out=whole_m)
    whole_m /= 1e2
    whole_m[np.isinf(range_m)] = math.inf
    return whole_m


def _metres(wire_cm: F64, max_cm: int) -> F64:
    range_m: F64 = wire_cm / 1e2
    range_m[wire_cm > max_cm] = math.inf
    range_m[wire_cm == UNKNOWN_CM] = math.nan
    return range_m


# --- setpoint -----------------------------------------------------------------------------------------------------


def encode_setpoint(
    setpoint: Setpoint, target_system: int = VEHICLE_SYSTEM, target_component: int = VEHICLE_COMPONENT
) -> Message:
    """SET_POSITION_TARGET_LOCAL_NED; a part that is None, and an axis that is NaN, is masked out (yaw rate always)."""
    mask, values = _setpoint_fields(setpoint)
    return mav.MAVLink_set_position_target_local_ned_message(
        to_ms(setpoint.t_s), target_system, target_component, mav.MAV_FRAME_LOCAL_NED, mask, *values, 0.0
    )


def decode_setpoint(message: Message) -> Setpoint:
    """The setpoint of a SET_POSITION_TARGET_LOCAL_NED in LOCAL_NED.

    A part whose three axes are masked out is None; a single masked axis is NaN ("not controlled").
    """
    m = message
    values = (m.x, m.y, m.z, m.vx, m.vy, m.vz, m.afx, m.afy, m.afz, m.yaw)
    return _setpoint(from_ms(m.time_boot_ms), m.type_mask, values)


def quantise_setpoint(setpoint: Setpoint) -> Setpoint:
    """The setpoint as the wire would deliver it: float32, whole milliseconds."""
    mask, values = _setpoint_fields(setpoint)
    return _setpoint(from_ms(to_ms(setpoint.t_s)), mask, _SETPOINT_F32.unpack(_SETPOINT_F32.pack(*values)))


def _setpoint_fields(setpoint: Setpoint) -> tuple[int, tuple[float, ...]]:
    mask = MASK_YAW_RATE
    pos, mask_pos = _part(setpoint.pos_ned_m, MASK_POS)
    vel, mask_vel = _part(setpoint.vel_ned_m_s, MASK_VEL)
    acc, mask_acc = _part(setpoint.acc_ned_m_s2, MASK_ACC)
    yaw = setpoint.yaw_rad
    if yaw is None:
        mask, yaw = mask | MASK_YAW, 0.0
    return mask | mask_pos | mask_vel | mask_acc, (*pos, *vel, *acc, yaw)


def _part(value: F64 | None, bits: tuple[int, int, int]) -> tuple[tuple[float, ...], int]:
    """Three wire values and the mask bits of the axes that are left out."""
    if value is None:
        return _NO_PART, sum(bits)
    axes = tuple(value.tolist())
    if not any(map(math.isnan, axes)):
        return axes, 0
    left_out = sum(bit for axis, bit in zip(axes, bits, strict=True) if math.isnan(axis))
    return tuple(0.0 if math.isnan(axis) else axis for axis in axes), left_out


def _setpoint(t_s: float, mask: int, values: tuple[float, ...]) -> Setpoint:
    return Setpoint(
        t_s=t_s,
        pos_ned_m=_axes(values[0:3], mask, MASK_POS),
        vel_ned_m_s=_axes(values[3:6], mask, MASK_VEL),
        acc_ned_m_s2=_axes(values[6:9], mask, MASK_ACC),
        yaw_rad=None if mask & MASK_YAW else values[9],
    )


def _axes(values: tuple[float, ...], mask: int, bits: tuple[int, int, int]) -> F64 | None:
    left_out = mask & (bits[0] | bits[1] | bits[2])
    if not left_out:
        return np.array(values)
    if left_out == sum(bits):
        return None
    return np.array([math.nan if mask & bit else value for value, bit in zip(values, bits, strict=True)])
