"""What does a setpoint message ask for? PX4's reading of masks, frames and NaN; pure; local ned."""

import math
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.codec import MASK_ACC, MASK_FORCE, MASK_POS, MASK_VEL, MASK_YAW, MASK_YAW_RATE
from companion.core.frames import wrap_rad
from companion.core.types import F64, Setpoint
from sitl.demand import AttitudeSetpoint, TrajectorySetpoint, no_axes
from sitl.geo import Origin

Message = Any  # a MAVLink_*_message object

GLOBAL_FRAMES: Final = (
    mav.MAV_FRAME_GLOBAL_INT,
    mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mav.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
IGNORE_RATES: Final = 7  # ATTITUDE_TARGET_TYPEMASK
IGNORE_THRUST: Final = 64
IGNORE_ATTITUDE: Final = 128
_ALL_ACC: Final = sum(MASK_ACC)


class SetpointError(ValueError):
    """A setpoint that PX4 refuses; the text is what it says."""


def local_ned(message: Message, yaw_rad: float) -> TrajectorySetpoint:
    """The setpoint of a SET_POSITION_TARGET_LOCAL_NED; ``yaw_rad``: the vehicle's, for frame BODY_NED.

    Raises SetpointError with PX4's text.
    """
    m, mask = message, message.type_mask
    pos = _axes((m.x, m.y, m.z), mask, MASK_POS)
    vel = _axes((m.vx, m.vy, m.vz), mask, MASK_VEL)
    acc = _axes((m.afx, m.afy, m.afz), mask, MASK_ACC)
    yaw = m.yaw if not mask & MASK_YAW else math.nan
    if m.coordinate_frame == mav.MAV_FRAME_BODY_NED:
        pos, vel, acc = no_axes(), _turned(vel, yaw_rad), _turned(acc, yaw_rad)
        yaw = wrap_rad(yaw + yaw_rad) if math.isfinite(yaw) else math.nan
    elif m.coordinate_frame != mav.MAV_FRAME_LOCAL_NED:
        raise SetpointError(f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {m.coordinate_frame} unsupported")
    if mask & MASK_FORCE and mask & _ALL_ACC != _ALL_ACC:
        raise SetpointError("SET_POSITION_TARGET_LOCAL_NED force not supported")
    if not (np.isfinite(pos).any() or np.isfinite(vel).any() or np.isfinite(acc).any()):
        raise SetpointError("SET_POSITION_TARGET_LOCAL_NED invalid")
    return TrajectorySetpoint(pos, vel, acc, yaw if math.isfinite(yaw) else math.nan, _nose(m)[1])


def global_int(message: Message, origin: Origin, home_down_m: float) -> TrajectorySetpoint:
    """The setpoint of a SET_POSITION_TARGET_GLOBAL_INT; terrain is taken to be as high as home.

    Raises SetpointError with PX4's text.
    """
    m, mask = message, message.type_mask
    if m.coordinate_frame not in GLOBAL_FRAMES:
        raise SetpointError(f"SET_POSITION_TARGET_GLOBAL_INT invalid coordinate frame {m.coordinate_frame}")
    lat_deg, lon_deg = m.lat_int / 1e7, m.lon_int / 1e7
    on_globe = abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0
    north_m, east_m = origin.north_east_m(lat_deg, lon_deg) if on_globe else (math.nan, math.nan)
    above_sea = m.coordinate_frame == mav.MAV_FRAME_GLOBAL_INT
    down_m = origin.down_m(m.alt) if above_sea else home_down_m - m.alt
    pos = _axes((north_m, east_m, down_m), mask, MASK_POS)
    vel = _axes((m.vx, m.vy, m.vz), mask, MASK_VEL)
    acc = _axes((m.afx, m.afy, m.afz), mask, MASK_ACC)
    if mask & MASK_FORCE and mask & _ALL_ACC != _ALL_ACC:
        raise SetpointError("SET_POSITION_TARGET_GLOBAL_INT force not supported")
    if not (np.isfinite(pos).any() or np.isfinite(vel).any() or np.isfinite(acc).any()):
        raise SetpointError("SET_POSITION_TARGET_GLOBAL_INT invalid")
    return TrajectorySetpoint(pos, vel, acc, *_nose(m))


def attitude(message: Message) -> AttitudeSetpoint | None:
    """The setpoint of a SET_ATTITUDE_TARGET; None when it is not usable."""
    m, mask = message, message.type_mask
    thrust = 0.0 if mask & IGNORE_THRUST else m.thrust
    rates = np.array([m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate])
    if not math.isfinite(thrust):
        return None
    if not mask & IGNORE_ATTITUDE:
        q = np.array(m.q, dtype=np.float64)
        size = float(np.linalg.norm(q))
        return AttitudeSetpoint(q / size, no_axes(), thrust) if 0.0 < size < math.inf else None
    if mask & IGNORE_RATES or not np.isfinite(rates).all():
        return None
    return AttitudeSetpoint(None, rates, thrust)


def of_companion(setpoint: Setpoint) -> TrajectorySetpoint:
    """A companion's setpoint as ``local_ned`` would read it from the wire: float32, yaw rate not given."""
    yaw_rad = math.nan if setpoint.yaw_rad is None else float(np.float32(setpoint.yaw_rad))
    return TrajectorySetpoint(
        _float32(setpoint.pos_ned_m), _float32(setpoint.vel_ned_m_s), _float32(setpoint.acc_ned_m_s2), yaw_rad, math.nan
    )


def _float32(vector: F64 | None) -> F64:
    return no_axes() if vector is None else vector.astype(np.float32).astype(np.float64)


def _nose(message: Message) -> tuple[float, float]:
    """Yaw and yaw rate; NaN where not given."""
    m, mask = message, message.type_mask
    yaw_rad = m.yaw if not mask & MASK_YAW and math.isfinite(m.yaw) else math.nan
    rate_rad_s = m.yaw_rate if not mask & MASK_YAW_RATE and math.isfinite(m.yaw_rate) else math.nan
    return yaw_rad, rate_rad_s


def _axes(values: tuple[float, float, float], mask: int, bits: tuple[int, int, int]) -> F64:
    return np.array(
        [v if not mask & bit and math.isfinite(v) else math.nan for v, bit in zip(values, bits, strict=True)]
    )


def _turned(vector: F64, yaw_rad: float) -> F64:
    """From the level frame along the nose to ned. An absent horizontal axis counts as zero beside a given one."""
    forward, right, down = vector.tolist()
    if math.isnan(forward) and math.isnan(right):
        return vector
    forward, right = (0.0 if math.isnan(v) else v for v in (forward, right))
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([cos * forward - sin * right, sin * forward + cos * right, down])
