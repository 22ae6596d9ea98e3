"""How is each MAVLink command answered? PX4's results; one handler a command, no sockets.

NaN in a parameter is normal (MAVSDK fills unused ones with it) and never an error by itself.
"""

import math
from collections.abc import Mapping
from typing import Final

from pymavlink.dialects.v20 import common as mav

from sitl import commands_guided, commands_mission, commands_system, modes
from sitl.answers import Result
from sitl.command import ACCEPTED, DENIED, FAILED, REJECTED, UNSUPPORTED, Answer, Command, Handler, answer, whole
from sitl.link import Link
from sitl.message_table import BUILDERS
from sitl.messages_modes import AVAILABLE_MODES_ID, PROTOCOL_VERSION_ID, available_modes
from sitl.simulation import Simulation

FORCE: Final = 21196.0  # MAV_CMD_COMPONENT_ARM_DISARM, p2: arm or disarm whatever the state
ANYBODY: Final = frozenset({mav.MAV_CMD_REQUEST_PROTOCOL_VERSION, mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES})


def execute(command: Command, sim: Simulation, link: Link) -> Answer:
    """Carry out a command that came over ``link``."""
    handler = HANDLERS.get(command.id)
    return handler(command, sim, link) if handler is not None else UNSUPPORTED


def request_message(message_id: int, sim: Simulation, index: float = math.nan) -> Answer:
    """One message on request: DENIED when it is unknown or not there yet. ``index``: which of several, 0: all."""
    if message_id == AVAILABLE_MODES_ID:
        modes_asked = available_modes(whole(index) or 0)
        return Answer(Result.ACCEPTED, tuple(modes_asked)) if modes_asked else DENIED
    builder = BUILDERS.get(message_id)
    message = builder(sim) if builder is not None else None
    return Answer(Result.ACCEPTED, (message,)) if message is not None else DENIED


def _arm(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Arm (p1 = 1) or disarm (0); p2 = 21196 does it always. Refused with a text when not ready, or in flight."""
    arm, force = command.params[0], command.params[1] == FORCE
    if arm == 1.0:
        return answer(sim.autopilot.command_arm(force))
    if arm == 0.0:
        return answer(sim.autopilot.command_disarm(force))
    return REJECTED


def _set_mode(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Change to a PX4 mode (p2 main, p3 sub): one honest answer; refused in flight when the mode cannot be flown."""
    flags, main, sub = (whole(p) for p in command.params[:3])
    if flags is None or main is None or not flags & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return REJECTED
    return answer(sim.autopilot.command_mode(modes.from_main_sub(main, sub or 0)))


def _takeoff(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Take off to p7 above sea level; NaN: MIS_TAKEOFF_ALT above here. Legal before arming."""
    alt_amsl_m = command.params[6]
    down_m = sim.origin.down_m(alt_amsl_m) if math.isfinite(alt_amsl_m) else None
    return answer(sim.autopilot.command_takeoff(down_m))


def _land(_command: Command, sim: Simulation, _link: Link) -> Answer:
    """Land here."""
    return answer(sim.autopilot.command_land())


def _return(_command: Command, sim: Simulation, _link: Link) -> Answer:
    """Return to home and land."""
    return answer(sim.autopilot.command_mode(modes.FlightMode.RTL))


def _request_message(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Send message p1 once; DENIED when it is unknown or not there yet. AVAILABLE_MODES: p2 is the index, 0 for all."""
    message_id = whole(command.params[0])
    return request_message(message_id, sim, command.params[1]) if message_id is not None else DENIED


def _set_interval(command: Command, _sim: Simulation, link: Link) -> Answer:
    """Stream message p1 every p2 microseconds on this link; 0: default, -1: off. FAILED for unknown ones."""
    message_id, interval_us = whole(command.params[0]), whole(command.params[1])
    extras = (command.params[2], command.params[3], command.params[6])
    if any(math.isfinite(p) and p != 0.0 for p in extras) or message_id is None or interval_us is None:
        return FAILED
    if message_id not in BUILDERS or message_id == mav.MAVLINK_MSG_ID_HEARTBEAT:
        return FAILED
    link.schedule_of(message_id).set_interval(message_id, interval_us)
    return ACCEPTED


def _get_interval(command: Command, _sim: Simulation, link: Link) -> Answer:
    """MESSAGE_INTERVAL of message p1 on this link."""
    message_id = whole(command.params[0])
    if message_id is None or not 0 <= message_id <= 0xFFFF:
        return FAILED
    off = -1 if message_id in BUILDERS else 0
    interval_us = link.schedule_of(message_id).interval_us(message_id) or off
    return Answer(Result.ACCEPTED, (mav.MAVLink_message_interval_message(message_id, interval_us),))


def _version(command: Command, sim: Simulation, _link: Link) -> Answer:
    """AUTOPILOT_VERSION; broadcasts are answered too."""
    return request_message(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION, sim)


def _protocol(command: Command, sim: Simulation, _link: Link) -> Answer:
    """PROTOCOL_VERSION; broadcasts are answered too."""
    return request_message(PROTOCOL_VERSION_ID, sim)


def _flight_information(command: Command, sim: Simulation, _link: Link) -> Answer:
    """FLIGHT_INFORMATION."""
    return request_message(mav.MAVLINK_MSG_ID_FLIGHT_INFORMATION, sim)


def _home(command: Command, sim: Simulation, _link: Link) -> Answer:
    """HOME_POSITION."""
    return request_message(mav.MAVLINK_MSG_ID_HOME_POSITION, sim)


HANDLERS: Final[Mapping[int, Handler]] = {
    mav.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mav.MAV_CMD_DO_SET_MODE: _set_mode,
    mav.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mav.MAV_CMD_NAV_LAND: _land,
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mav.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _version,
    mav.MAV_CMD_REQUEST_PROTOCOL_VERSION: _protocol,
    mav.MAV_CMD_GET_HOME_POSITION: _home,
    mav.MAV_CMD_REQUEST_FLIGHT_INFORMATION: _flight_information,
    **commands_guided.HANDLERS,
    **commands_mission.HANDLERS,
    **commands_system.HANDLERS,
}
