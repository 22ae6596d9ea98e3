"""What does the autopilot do about each trouble? PX4's actions in order of severity, chosen by its parameters; pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Final

from sitl.modes import FlightMode
from sitl.px4_params import ParamStore
from sitl.steering import Behaviour

NO_TERMINATION: Final = 121212  # CBRK_FLIGHTTERM: the circuit breaker is in
EARLY_FLIGHT_S: Final = 3.0  # after spool-up: a critical failure disarms


class Action(IntEnum):
    """PX4's failsafe actions; a greater one is chosen before a smaller one."""

    NONE = 0
    WARN = 1
    POSITION = 2
    ALTITUDE = 3
    STABILIZED = 4
    HOLD = 5
    RETURN = 6
    LAND = 7
    DESCEND = 8
    DISARM = 9
    TERMINATE = 10


class Clears(Enum):
    """When an action ends although nobody ends it."""

    WITH_CONDITION = "condition"
    ON_MODE_CHANGE = "mode change"  # or disarming, once the condition is gone
    NEVER = "never"


class Takeover(IntEnum):
    """May a person end the action by choosing a mode?"""

    ALWAYS = 0
    AFTER_DELAY = 1  # PX4's Auto: COM_FAIL_ACT_T of Hold come before the action
    MODE_SWITCH = 2
    NEVER = 3


class Cause(Enum):
    """What went wrong."""

    GCS_LOST = "ground station lost"
    GEOFENCE = "geofence breached"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery emergency"
    ATTITUDE = "attitude failure"
    MOTOR = "motor failure"
    FALLBACK = "mode cannot go on"


class Charge(IntEnum):
    """What the battery monitor says."""

    FINE = 0
    LOW = 1
    CRITICAL = 2
    EMERGENCY = 3


@dataclass(frozen=True, slots=True)
class Failsafe:
    """The mode that HEARTBEAT shows and what the vehicle does in it."""

    mode: FlightMode
    behaviour: Behaviour


@dataclass(frozen=True, slots=True)
class Response:
    """What one trouble asks for."""

    action: Action
    takeover: Takeover = Takeover.AFTER_DELAY
    clears: Clears = Clears.WITH_CONDITION


@dataclass(frozen=True, slots=True)
class Facts:
    """What the autopilot knows at one control tick."""

    t_s: float
    armed: bool
    user_mode: FlightMode
    armed_for_s: float = math.inf
    mode_changed: bool = False  # a person chose a mode since the last tick
    offboard_lost: bool = False  # OFFBOARD is wanted and has no setpoints
    gcs_lost: bool = False
    breached: bool = False
    charge: Charge = Charge.FINE
    attitude_failed: bool = False
    motor_failed: bool = False
    position_ok: bool = True
    attitude_ok: bool = True
    needs_position: bool = True  # can the user's mode not go on without it?


# Position, Altitude and Stabilized want sticks; without them PX4 shows the mode and comes down.
FAILSAFES: Final = {
    Action.POSITION: Failsafe(FlightMode.POSCTL, Behaviour.LAND),
    Action.ALTITUDE: Failsafe(FlightMode.ALTCTL, Behaviour.LAND),
    Action.STABILIZED: Failsafe(FlightMode.STABILIZED, Behaviour.LAND),
    Action.HOLD: Failsafe(FlightMode.HOLD, Behaviour.HOLD),
    Action.RETURN: Failsafe(FlightMode.RTL, Behaviour.RETURN),
    Action.LAND: Failsafe(FlightMode.LAND, Behaviour.LAND),
    Action.DESCEND: Failsafe(FlightMode.LAND, Behaviour.DESCEND),
    Action.DISARM: Failsafe(FlightMode.TERMINATION, Behaviour.CUT),
    Action.TERMINATE: Failsafe(FlightMode.TERMINATION, Behaviour.CUT),
}
_OFFBOARD_LOSS: Final = {  # COM_OBL_RC_ACT
    0: Action.POSITION,
    1: Action.ALTITUDE,
    2: Action.STABILIZED,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
_LINK_LOSS: Final = {  # NAV_DLL_ACT
    1: Response(Action.HOLD, clears=Clears.ON_MODE_CHANGE),
    2: Response(Action.RETURN, clears=Clears.ON_MODE_CHANGE),
    3: Response(Action.LAND, clears=Clears.ON_MODE_CHANGE),
    5: Response(Action.TERMINATE, Takeover.NEVER, Clears.NEVER),
    6: Response(Action.DISARM, Takeover.NEVER),
}
_GEOFENCE: Final = {  # GF_ACTION
    1: Response(Action.WARN),
    2: Response(Action.HOLD, Takeover.MODE_SWITCH, Clears.ON_MODE_CHANGE),
    3: Response(Action.RETURN, clears=Clears.ON_MODE_CHANGE),
    4: Response(Action.TERMINATE, Takeover.NEVER, Clears.NEVER),
    5: Response(Action.LAND, clears=Clears.ON_MODE_CHANGE),
}
_MOTOR: Final = {  # COM_ACT_FAIL_ACT
    1: Response(Action.HOLD),
    2: Response(Action.LAND, clears=Clears.ON_MODE_CHANGE),
    3: Response(Action.RETURN, clears=Clears.ON_MODE_CHANGE),
    4: Response(Action.TERMINATE, clears=Clears.NEVER),
}
_BATTERY: Final = {  # COM_LOW_BAT_ACT: at critical charge, at emergency
    1: (Action.RETURN, Action.RETURN),
    2: (Action.LAND, Action.LAND),
    3: (Action.RETURN, Action.LAND),
}
_BATTERY_CAUSES: Final = {
    Charge.LOW: Cause.BATTERY_LOW,
    Charge.CRITICAL: Cause.BATTERY_CRITICAL,
    Charge.EMERGENCY: Cause.BATTERY_EMERGENCY,
}


def without_sticks(params: ParamStore) -> FlightMode:
    """The mode that follows a mode that wants sticks when they are lost (NAV_RCL_ACT)."""
    modes = {1: FlightMode.HOLD, 3: FlightMode.LAND, 5: FlightMode.TERMINATION}
    return modes.get(int(params["NAV_RCL_ACT"]), FlightMode.RTL)


def responses(facts: Facts, params: ParamStore) -> Mapping[Cause, Response]:
    """Everything that is wrong now and what it asks for."""
    found: dict[Cause, Response] = {}
    if facts.gcs_lost and facts.armed and facts.user_mode is not FlightMode.LAND:
        found[Cause.GCS_LOST] = _LINK_LOSS.get(int(params["NAV_DLL_ACT"]), Response(Action.NONE))
    if facts.breached:
        found[Cause.GEOFENCE] = _GEOFENCE.get(int(params["GF_ACTION"]), Response(Action.NONE))
    if facts.charge is not Charge.FINE:
        found[_BATTERY_CAUSES[facts.charge]] = Response(_battery(facts.charge, int(params["COM_LOW_BAT_ACT"])))
    if facts.attitude_failed:
        found[Cause.ATTITUDE] = Response(_attitude(facts, params))
    if facts.motor_failed:
        found[Cause.MOTOR] = _MOTOR.get(int(params["COM_ACT_FAIL_ACT"]), Response(Action.WARN))
    fallback = _fallback(facts, params)
    if fallback is not Action.NONE:
        found[Cause.FALLBACK] = Response(fallback, Takeover.ALWAYS)
    return {cause: response for cause, response in found.items() if response.action is not Action.NONE}


def possible(action: Action, facts: Facts) -> Action:
    """The action that can be carried out: without a position PX4 comes down level, without an attitude it gives up."""
    if not facts.attitude_ok and Action.POSITION <= action <= Action.DESCEND:
        return Action.TERMINATE
    if not facts.position_ok and Action.POSITION <= action <= Action.LAND:
        return Action.DESCEND
    return action


def _battery(charge: Charge, setting: int) -> Action:
    critical, emergency = _BATTERY.get(setting, (Action.WARN, Action.WARN))
    return {Charge.CRITICAL: critical, Charge.EMERGENCY: emergency}.get(charge, Action.WARN)


def _attitude(facts: Facts, params: ParamStore) -> Action:
    if facts.armed_for_s < params["COM_SPOOLUP_TIME"] + EARLY_FLIGHT_S:
        return Action.DISARM
    return Action.WARN if params["CBRK_FLIGHTTERM"] == NO_TERMINATION else Action.TERMINATE


def _fallback(facts: Facts, params: ParamStore) -> Action:
    """What is flown when the chosen mode cannot go on."""
    if not facts.attitude_ok:
        return Action.TERMINATE
    if facts.offboard_lost:
        return _OFFBOARD_LOSS.get(int(params["COM_OBL_RC_ACT"]), Action.LAND)  # unknown: land
    if facts.needs_position and not facts.position_ok:
        return Action.DESCEND
    return Action.NONE
