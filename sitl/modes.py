"""Which flight modes does the autopilot know, and what does each allow? PX4's names, codes and rules; pure.

The value of a ``FlightMode`` is the ``custom_mode`` of HEARTBEAT: main mode in bits 16..23, sub mode in bits 24..31.
"""

from enum import IntEnum
from typing import Final

from pymavlink.dialects.v20 import common as mav

MAIN_POSCTL: Final = 3
MAIN_AUTO: Final = 4
MAIN_OFFBOARD: Final = 6


class FlightMode(IntEnum):
    """PX4's navigation states that HEARTBEAT can tell apart."""

    MANUAL = 1 << 16
    ALTCTL = 2 << 16
    POSCTL = MAIN_POSCTL << 16
    ACRO = 5 << 16
    OFFBOARD = MAIN_OFFBOARD << 16
    STABILIZED = 7 << 16
    TERMINATION = 10 << 16
    ORBIT = MAIN_POSCTL << 16 | 1 << 24
    POSITION_SLOW = MAIN_POSCTL << 16 | 2 << 24
    TAKEOFF = MAIN_AUTO << 16 | 2 << 24
    HOLD = MAIN_AUTO << 16 | 3 << 24
    MISSION = MAIN_AUTO << 16 | 4 << 24
    RTL = MAIN_AUTO << 16 | 5 << 24
    LAND = MAIN_AUTO << 16 | 6 << 24
    FOLLOW = MAIN_AUTO << 16 | 8 << 24
    PRECISION_LAND = MAIN_AUTO << 16 | 9 << 24


# What PX4 calls a mode in "Switching to X is currently not available".
TITLES: Final = {
    FlightMode.MANUAL: "Manual",
    FlightMode.ALTCTL: "Altitude",
    FlightMode.POSCTL: "Position",
    FlightMode.ACRO: "Acro",
    FlightMode.OFFBOARD: "Offboard",
    FlightMode.STABILIZED: "Stabilized",
    FlightMode.TERMINATION: "Termination",
    FlightMode.ORBIT: "Orbit",
    FlightMode.POSITION_SLOW: "Position Slow",
    FlightMode.TAKEOFF: "Takeoff",
    FlightMode.HOLD: "Hold",
    FlightMode.MISSION: "Mission",
    FlightMode.RTL: "Return",
    FlightMode.LAND: "Land",
    FlightMode.FOLLOW: "Follow Target",
    FlightMode.PRECISION_LAND: "Precision Landing",
}

# Modes that need sticks.
MANUAL: Final = frozenset(
    {
        FlightMode.MANUAL,
        FlightMode.ALTCTL,
        FlightMode.POSCTL,
        FlightMode.POSITION_SLOW,
        FlightMode.ACRO,
        FlightMode.STABILIZED,
    }
)
# Modes that steer without sticks and mission; OFFBOARD only while its stream is fresh.
FLYABLE: Final = frozenset(
    {
        FlightMode.HOLD,
        FlightMode.TAKEOFF,
        FlightMode.LAND,
        FlightMode.RTL,
        FlightMode.OFFBOARD,
        FlightMode.ORBIT,
        FlightMode.FOLLOW,
        FlightMode.TERMINATION,
    }
)
# Modes that a pilot's stick ends (COM_RC_OVERRIDE). In Orbit and Follow Target it changes what is flown.
AUTONOMOUS: Final = frozenset(
    {FlightMode.HOLD, FlightMode.TAKEOFF, FlightMode.LAND, FlightMode.RTL, FlightMode.MISSION}
)
# Modes in which PX4 lets the motors start; OFFBOARD with setpoints, MISSION with one, those of MANUAL with sticks.
ARMABLE: Final = frozenset({FlightMode.HOLD, FlightMode.TAKEOFF, FlightMode.OFFBOARD, FlightMode.MISSION})

_AUTO_FLAGS: Final = (
    mav.MAV_MODE_FLAG_AUTO_ENABLED | mav.MAV_MODE_FLAG_GUIDED_ENABLED | mav.MAV_MODE_FLAG_STABILIZE_ENABLED
)
_STICK_FLAGS: Final = mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED | mav.MAV_MODE_FLAG_STABILIZE_ENABLED


def from_main_sub(main: int, sub: int) -> FlightMode | None:
    """The mode that MAV_CMD_DO_SET_MODE asks for with (p2, p3), or None where PX4 has none."""
    code = main << 16 | (sub << 24 if main in (MAIN_POSCTL, MAIN_AUTO) else 0)
    return FlightMode(code) if code in TITLES else None


def from_custom_mode(custom_mode: int) -> FlightMode | None:
    """The mode of a HEARTBEAT or SET_MODE."""
    return from_main_sub(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)


def base_mode(mode: FlightMode, armed: bool) -> int:
    """MAV_MODE_FLAG bits as PX4 sends them: 29 HOLD, 157 armed, 17 and 145 OFFBOARD, 81 and 209 POSCTL."""
    flags: int = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    main = mode >> 16 & 0xFF
    if main == MAIN_AUTO:
        flags |= _AUTO_FLAGS
    elif main == MAIN_OFFBOARD:
        flags |= mav.MAV_MODE_FLAG_STABILIZE_ENABLED
    elif mode is FlightMode.MANUAL or mode is FlightMode.ACRO:
        flags |= mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    elif mode is not FlightMode.TERMINATION:
        flags |= _STICK_FLAGS
    return flags | (mav.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
