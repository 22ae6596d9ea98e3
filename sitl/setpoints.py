"""What does a setpoint message ask for? PX4's reading of masks, frames and NaN; pure; local ned."""

import math
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.codec import MASK_ACC, MASK_FORCE, MASK_POS, MASK_VEL, MASK_YAW, MASK_YAW_RATE
from companion.core.frames import wrap_rad
from companion.core.types import F64, Setpoint
from sitl.demand import TrajectorySetpoint, no_axes

Message = Any  # a MAVLink_*_message object

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
    return TrajectorySetpoint(
        pos,
        vel,
        acc,
        yaw if math.isfinite(yaw) else math.nan,
        m.yaw_rate if not mask & MASK_YAW_RATE and math.isfinite(m.yaw_rate) else math.nan,
    )


def of_companion(setpoint: Setpoint) -> TrajectorySetpoint:
    """A companion's setpoint as ``local_ned`` would read it from the wire: float32, yaw rate not given."""
    yaw_rad = math.nan if setpoint.yaw_rad is None else float(np.float32(setpoint.yaw_rad))
    return TrajectorySetpoint(
        _float32(setpoint.pos_ned_m), _float32(setpoint.vel_ned_m_s), _float32(setpoint.acc_ned_m_s2), yaw_rad, math.nan
    )


def _float32(vector: F64 | None) -> F64:
    return no_axes() if vector is None else vector.astype(np.float32).astype(np.float64)


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
