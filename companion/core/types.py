"""Which values cross the borders between modules? Immutable, SI, radians; frames in the names.

Arrays are float64 and must be treated as read-only. Absent is ``None``. Local ``ned`` has its origin where the
autopilot booted (PX4's local origin); ``frd`` is the body frame.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


class NavMode(StrEnum):
    """Who steers. Hold is an overlay and not a mode (see ``arbiter``)."""

    TRAVEL = "travel"
    RL = "rl"
    LANDING = "landing"


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


@dataclass(frozen=True, slots=True)
class VehicleState:
    """The autopilot's estimate at one instant of vehicle time."""

    t_s: float
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    q_ned_frd: F64  # (4,) w, x, y, z: gives ned from frd
    rates_frd_rad_s: F64  # (3,)


@dataclass(frozen=True, slots=True)
class AutopilotStatus:
    """What the autopilot says of itself."""

    armed: bool
    offboard: bool
    landed: LandedState


@dataclass(frozen=True, slots=True)
class Scan:
    """One planar LiDAR sweep in the body plane, as OBSTACLE_DISTANCE carries it.

    Sector ``i`` is centred on bearing ``angle_offset_rad + i * increment_rad`` (0 nose, right positive) and reports the
    nearest surface within half an increment to either side. ``range_m``: finite = hit (slant range in the body plane),
    ``inf`` = measured, nothing within ``range_max_m``, ``nan`` = unknown.
    """

    t_s: float
    range_m: F64  # (n,)
    angle_offset_rad: float
    increment_rad: float
    range_min_m: float
    range_max_m: float


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the autopilot is asked for: local ned; ``t_s`` is the instant of the scan that it answers."""

    t_s: float
    pos_ned_m: F64 | None  # (3,)
    vel_ned_m_s: F64 | None  # (3,) feed-forward
    acc_ned_m_s2: F64 | None  # (3,) feed-forward
    yaw_rad: float | None
