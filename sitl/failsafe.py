"""What does the autopilot do when the OFFBOARD stream is lost? COM_OBL_RC_ACT on a vehicle without sticks; pure."""

from dataclasses import dataclass
from typing import Final

from sitl.modes import FlightMode
from sitl.steering import Behaviour


@dataclass(frozen=True, slots=True)
class Failsafe:
    """The mode that HEARTBEAT shows and what the vehicle does in it."""

    mode: FlightMode
    behaviour: Behaviour


# Position, Altitude and Stabilized want sticks; without them PX4 shows the mode and comes down.
_ACTIONS: Final = {
    0: Failsafe(FlightMode.POSCTL, Behaviour.LAND),
    1: Failsafe(FlightMode.ALTCTL, Behaviour.LAND),
    2: Failsafe(FlightMode.STABILIZED, Behaviour.LAND),
    3: Failsafe(FlightMode.RTL, Behaviour.RETURN),
    4: Failsafe(FlightMode.LAND, Behaviour.LAND),
    5: Failsafe(FlightMode.HOLD, Behaviour.HOLD),
    6: Failsafe(FlightMode.TERMINATION, Behaviour.CUT),
    7: Failsafe(FlightMode.TERMINATION, Behaviour.CUT),
}


def offboard_loss(action: int) -> Failsafe:
    """The failsafe of a value of COM_OBL_RC_ACT; an unknown value lands."""
    return _ACTIONS.get(action, _ACTIONS[4])
