"""What is a command and its answer? Values only, so that every file of handlers can share them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.answers import CommandResult, Result
from sitl.link import Link
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

INT_NAN: Final = (0x7FF80000, 0x7FFFFFFF, -0x80000000)  # x and y of a COMMAND_INT that mean "not given"


@dataclass(frozen=True, slots=True)
class Command:
    """One COMMAND_LONG, COMMAND_INT or SET_MODE; p7 is ``params[6]``."""

    id: int
    params: tuple[float, ...]  # (7,); p5 and p6 of a COMMAND_INT are degrees: 1e-7 of what is on the wire
    frame: int = mav.MAV_FRAME_GLOBAL


@dataclass(frozen=True, slots=True)
class Answer:
    """What goes back on the link that asked: messages first, then COMMAND_ACK."""

    result: int
    messages: tuple[Message, ...] = ()


Handler = Callable[[Command, Simulation, Link], Answer]

ACCEPTED: Final = Answer(Result.ACCEPTED)
REJECTED: Final = Answer(Result.TEMPORARILY_REJECTED)
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
    return Command(m.command, (m.param1, m.param2, m.param3, m.param4, _scaled(m.x), _scaled(m.y), m.z), m.frame)


def from_set_mode(message: Message) -> Command:
    """The MAV_CMD_DO_SET_MODE that a SET_MODE stands for."""
    main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
    return Command(mav.MAV_CMD_DO_SET_MODE, (float(message.base_mode), float(main), float(sub), *[math.nan] * 4))


def answer(result: CommandResult) -> Answer:
    """The ACK of what the autopilot said."""
    return Answer(int(result.result))


def whole(value: float) -> int | None:
    """A parameter as an integer; None for NaN and infinity."""
    return int(value) if math.isfinite(value) else None


def _scaled(value: int) -> float:
    return math.nan if value in INT_NAN else value / 1e7
