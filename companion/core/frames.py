"""How do angles and frames convert? Pure; quaternions are w, x, y, z and ``q_ned_frd`` gives ned from frd."""

import math

import numpy as np

from companion.core.types import F64


def wrap_rad(angle_rad: float) -> float:
    """Wrap to (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def rotation_ned_frd(q_ned_frd: F64) -> F64:
    """Rotation matrix (3, 3) that takes frd vectors to ned."""
    w, x, y, z = q_ned_frd.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def down_frd_ned(q_ned_frd: F64) -> tuple[float, float, float]:
    """Where the body's down axis points, ned: the last column of ``rotation_ned_frd``."""
    w, x, y, z = q_ned_frd.tolist()
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)


def euler_rad(q_ned_frd: F64) -> tuple[float, float, float]:
    """Roll, pitch, yaw (Z-Y-X, radians)."""
    w, x, y, z = q_ned_frd.tolist()
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return roll, pitch, yaw


def yaw_rad(q_ned_frd: F64) -> float:
    """Yaw: 0 north, clockwise positive."""
    return euler_rad(q_ned_frd)[2]


def quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> F64:
    """q_ned_frd from roll, pitch, yaw (Z-Y-X)."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )
