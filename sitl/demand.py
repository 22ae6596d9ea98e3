"""What does the autopilot ask of the control loops right now? Values; local ned.

NaN on an axis means "not controlled" (position) or "no feed-forward" (velocity, acceleration), as inside PX4.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from companion.core.types import F64

_NO_AXES: Final = np.full(3, math.nan)
_NO_AXES.flags.writeable = False


class Loop(Enum):
    """Which control loop a demand enters."""

    IDLE = "idle"  # rotors turn, no lift
    POSITION = "position"
    ATTITUDE = "attitude"
    RATES = "rates"


def no_axes() -> F64:
    """(3,) of NaN: nothing asked on any axis. Always the same, read-only."""
    return _NO_AXES


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """Compared by identity: the same object is applied to the vehicle once."""

    loop: Loop
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    acc_ned_m_s2: F64  # (3,)
    yaw_rad: float  # NaN: turn at yaw_rate_rad_s
    yaw_rate_rad_s: float
    q_ned_frd: F64 | None = None  # (4,) of Loop.ATTITUDE
    rates_frd_rad_s: F64 | None = None  # (3,) of Loop.RATES
    thrust_norm: float = 0.0  # of both: fraction of full thrust


@dataclass(frozen=True, slots=True, eq=False)
class TrajectorySetpoint:
    """What an OFFBOARD client asks for, masks and frames already resolved; PX4's trajectory_setpoint."""

    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    acc_ned_m_s2: F64  # (3,)
    yaw_rad: float  # NaN: not given
    yaw_rate_rad_s: float  # NaN: not given


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeSetpoint:
    """What an OFFBOARD client asks for below the position loop: an attitude, or body rates where that is None."""

    q_ned_frd: F64 | None  # (4,)
    rates_frd_rad_s: F64  # (3,)
    thrust_norm: float


OffboardSetpoint = TrajectorySetpoint | AttitudeSetpoint

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


def attitude_demand(q_ned_frd: F64, thrust_norm: float) -> Demand:
    """A demand of attitude and collective thrust."""
    return Demand(
        Loop.ATTITUDE, no_axes(), no_axes(), no_axes(), math.nan, 0.0, q_ned_frd=q_ned_frd, thrust_norm=thrust_norm
    )


def rates_demand(rates_frd_rad_s: F64, thrust_norm: float) -> Demand:
    """A demand of body rates and collective thrust."""
    return Demand(
        Loop.RATES,
        no_axes(),
        no_axes(),
        no_axes(),
        math.nan,
        0.0,
        rates_frd_rad_s=rates_frd_rad_s,
        thrust_norm=thrust_norm,
    )
