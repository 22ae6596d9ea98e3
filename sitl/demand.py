"""What does the autopilot ask of the control loops right now? Values; local ned.

NaN on an axis means "not controlled" (position) or "no feed-forward" (velocity, acceleration), as inside PX4.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from companion.core.types import F64


class Loop(Enum):
    """Which control loop a demand enters."""

    IDLE = "idle"  # rotors turn, no lift
    POSITION = "position"


def no_axes() -> F64:
    """(3,) of NaN: nothing asked on any axis."""
    return np.full(3, math.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """Compared by identity: the same object is applied to the vehicle once."""

    loop: Loop
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    acc_ned_m_s2: F64  # (3,)
    yaw_rad: float  # NaN: turn at yaw_rate_rad_s
    yaw_rate_rad_s: float


@dataclass(frozen=True, slots=True, eq=False)
class TrajectorySetpoint:
    """What an OFFBOARD client asks for, masks and frames already resolved; PX4's trajectory_setpoint."""

    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    acc_ned_m_s2: F64  # (3,)
    yaw_rad: float  # NaN: not given
    yaw_rate_rad_s: float  # NaN: not given


IDLE: Final = Demand(Loop.IDLE, no_axes(), no_axes(), no_axes(), math.nan, math.nan)


def position_demand(
    pos_ned_m: F64, yaw_rad: float, vel_ned_m_s: F64 | None = None, acc_ned_m_s2: F64 | None = None
) -> Demand:
    """A demand of position and yaw with optional feed-forward."""
    return Demand(
        Loop.POSITION,
        pos_ned_m,
        no_axes() if vel_ned_m_s is None else vel_ned_m_s,
        no_axes() if acc_ned_m_s2 is None else acc_ned_m_s2,
        yaw_rad,
        0.0,
    )
