"""How is each MAVLink command answered? PX4's results; one handler a command, no sockets.

NaN in a parameter is normal (MAVSDK fills unused ones with it) and never an error by itself.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from pymavlink.dialects.v20 import common as mav

from sitl import modes
from sitl.answers import CommandResult, Result
from sitl.extra_messages import PROTOCOL_VERSION_ID, protocol_version
from sitl.link import Link
from sitl.messages import BUILDERS, ORIGIN, Message
from sitl.simulation import Simulation

FORCE: Final = 21196.0  # MAV_CMD_COMPONENT_ARM_DISARM, p2: arm or disarm whatever the state
ANYBODY: Final = frozenset({mav.MAV_CMD_REQUEST_PROTOCOL_VERSION, mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES})


@dataclass(frozen=True, slots=True)
class Command:
    """One COMMAND_LONG, COMMAND_INT or SET_MODE; p7 is ``params[6]``."""

    id: int
    params: tuple[float, ...]  # (7,); p5 and p6 of a COMMAND_INT are as on the wire


@dataclass(frozen=True, slots=True)
class Answer:
    """What goes back on the link that asked: messages first, then COMMAND_ACK."""

    result: int
    messages: tuple[Message, ...] = ()


ACCEPTED: Final = Answer(Result.ACCEPTED)
DENIED: Final = Answer(Result.DENIED)
FAILED: Final = Answer(Result.FAILED)
UNSUPPORTED: Final = Answer(Result.UNSUPPORTED)


def from_long(message: Message) -> Command:
    """The command of a COMMAND_LONG."""
    m = message
    return Command(m.command, (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7))


def from_int(message: Message) -> Command:
    """The command of a COMMAND_INT."""
    m = message
    return Command(m.command, (m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z))


def from_set_mode(message: Message) -> Command:
    """The MAV_CMD_DO_SET_MODE that a SET_MODE stands for."""
    main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
    return Command(mav.MAV_CMD_DO_SET_MODE, (float(message.base_mode), float(main), float(sub), *[math.nan] * 4))


def execute(command: Command, sim: Simulation, link: Link) -> Answer:
    """Carry out a command that came over ``link``."""
    handler = _HANDLERS.get(command.id)
    return handler(command, sim, link) if handler is not None else UNSUPPORTED


def request_message(message_id: int, sim: Simulation) -> Answer:
    """One message on request: DENIED when it is unknown or not there yet."""
    if message_id == PROTOCOL_VERSION_ID:
        return Answer(Result.ACCEPTED, (protocol_version(),))
    builder = BUILDERS.get(message_id)
    message = builder(sim) if builder is not None else None
    return Answer(Result.ACCEPTED, (message,)) if message is not None else DENIED


def _arm(command: Command, sim: Simulation, _link: Link) -> Answer:
    arm, force = command.params[0], command.params[1] == FORCE
    if arm == 1.0:
        return _answer(sim.autopilot.command_arm(force))
    if arm == 0.0:
        return _answer(sim.autopilot.command_disarm(force))
    return Answer(Result.TEMPORARILY_REJECTED)


def _set_mode(command: Command, sim: Simulation, _link: Link) -> Answer:
    flags, main, sub = (_whole(p) for p in command.params[:3])
    if flags is None or main is None or not flags & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Answer(Result.TEMPORARILY_REJECTED)
    return _answer(sim.autopilot.command_mode(modes.from_main_sub(main, sub or 0)))


def _takeoff(command: Command, sim: Simulation, _link: Link) -> Answer:
    alt_amsl_m = command.params[6]
    down_m = ORIGIN.down_m(alt_amsl_m) if math.isfinite(alt_amsl_m) else None
    return _answer(sim.autopilot.command_takeoff(down_m))


def _land(_command: Command, sim: Simulation, _link: Link) -> Answer:
    return _answer(sim.autopilot.command_land())


def _return(_command: Command, sim: Simulation, _link: Link) -> Answer:
    return _answer(sim.autopilot.command_mode(modes.FlightMode.RTL))


def _request_message(command: Command, sim: Simulation, _link: Link) -> Answer:
    message_id = _whole(command.params[0])
    return request_message(message_id, sim) if message_id is not None else DENIED


def _set_interval(command: Command, _sim: Simulation, link: Link) -> Answer:
    message_id, interval_us = _whole(command.params[0]), _whole(command.params[1])
    extras = (command.params[2], command.params[3], command.params[6])
    if any(math.isfinite(p) and p != 0.0 for p in extras) or message_id is None or interval_us is None:
        return FAILED
    if message_id not in BUILDERS or message_id == mav.MAVLINK_MSG_ID_HEARTBEAT:
        return FAILED
    link.schedule_of(message_id).set_interval(message_id, interval_us)
    return ACCEPTED


def _get_interval(command: Command, _sim: Simulation, link: Link) -> Answer:
    message_id = _whole(command.params[0])
    if message_id is None or not 0 <= message_id <= 0xFFFF:
        return FAILED
    off = -1 if message_id in BUILDERS else 0
    interval_us = link.schedule_of(message_id).interval_us(message_id) or off
    return Answer(Result.ACCEPTED, (mav.MAVLink_message_interval_message(message_id, interval_us),))


def _version(command: Command, sim: Simulation, _link: Link) -> Answer:
    return request_message(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION, sim)


def _protocol(command: Command, sim: Simulation, _link: Link) -> Answer:
    return request_message(PROTOCOL_VERSION_ID, sim)


def _home(command: Command, sim: Simulation, _link: Link) -> Answer:
    return request_message(mav.MAVLINK_MSG_ID_HOME_POSITION, sim)


_HANDLERS: Final[Mapping[int, Callable[[Command, Simulation, Link], Answer]]] = {
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
}


def _answer(result: CommandResult) -> Answer:
    return Answer(int(result.result))


def _whole(value: float) -> int | None:
    """A parameter as an integer; None for NaN and infinity."""
    return int(value) if math.isfinite(value) else None
