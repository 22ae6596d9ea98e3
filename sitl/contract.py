"""Which messages, commands, modes and parameters does the vehicle support? ``python -m sitl.contract`` writes the page.

Everything is read off the tables that the vehicle runs on, and off the first sentence of what stands in them.
"""

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from sitl import commands
from sitl.message_table import BUILDERS
from sitl.mission_protocol import MissionProtocol
from sitl.mission_store import MissionStore
from sitl.modes import ARMABLE, FLYABLE, MANUAL, TITLES, FlightMode
from sitl.px4_param_table import HONOURED, KEPT, Px4Param
from sitl.router import Router
from sitl.simulation import Simulation
from sitl.streams import CURRENT_MODE_ID, GCS_HZ, LEAN_HZ, ONBOARD_HZ
from sitl.world import World

NAMES: Final = {CURRENT_MODE_ID: "CURRENT_MODE", 300: "PROTOCOL_VERSION"}  # not in pymavlink's dialect
# Sent as answers or when something happens, not by a rate.
ANSWERS: Final = {
    "AVAILABLE_MODES": "one for each mode, on request",
    "COMMAND_ACK": "exactly one for each command, to its sender",
    "LOG_ENTRY, LOG_DATA": "flight logs",
    "FILE_TRANSFER_PROTOCOL": "NAK",
    "MESSAGE_INTERVAL": "on request",
    "MISSION_COUNT, MISSION_REQUEST_INT, MISSION_ITEM_INT, MISSION_ACK": "transfers of missions, fences, rally points",
    "MISSION_CURRENT": "every second and at every change",
    "MISSION_ITEM_REACHED": "when an item is reached, repeated",
    "PARAM_VALUE": "on request and after every change",
    "SERIAL_CONTROL": "the shell's prompt",
    "STATUSTEXT": "PX4's texts, in chunks when longer than 50 bytes",
}
# Understood, and without effect here.
IDLE: Final = {
    "OBSTACLE_DISTANCE, DISTANCE_SENSOR": "the vehicle has its own LiDAR; PX4 prevents collisions under sticks only",
    "STATUSTEXT, SYSTEM_TIME": "heard",
    "REQUEST_DATA_STREAM": "rates are set by SET_MESSAGE_INTERVAL",
    "GPS_RTCM_DATA, PLAY_TUNE, PLAY_TUNE_V2": "there is no receiver and no buzzer",
    "VISION_POSITION_ESTIMATE, ATT_POS_MOCAP, ODOMETRY": "the estimate takes no external vision",
    "ADSB_VEHICLE, RADIO_STATUS, TRAJECTORY_REPRESENTATION_WAYPOINTS": "as PX4 without such a device",
    "REQUEST_EVENT": "no events are sent",
    "Commands addressed to a camera, gimbal or winch": "silence: no such component is there, as with a bare PX4",
}
# PX4 sends these; the vehicle does not. A request is DENIED, a rate FAILED.
NOT_SENT: Final = {
    "EVENT, CURRENT_EVENT_SEQUENCE": "every event is a STATUSTEXT as well, without the tab that lets it be dropped",
    "COMPONENT_METADATA, COMPONENT_INFORMATION": "there are no files to point to",
    "LINK_NODE_STATUS, RC_CHANNELS, ESC_STATUS, TIME_ESTIMATE_TO_TARGET": "no source for them",
    "PARAM_ERROR": "newer than PX4 v1.16",
}
REST: Final = """\
* Any other command: COMMAND_ACK with UNSUPPORTED. A command for another system or component: silence.
* Any other message, known or not: ignored silently. So are bytes that are no packet.
* A request for any other message: DENIED. A rate for any other message: FAILED.
* PARAM_REQUEST_READ and PARAM_SET of an unknown name, or with the wrong type: silence, as in PX4 v1.16.
* File transfer: NAK. AVAILABLE_MODES: all of them or DENIED.
* NaN in a parameter of a command is no error: it means "not given".
"""


def page() -> str:
    """The whole page as Markdown."""
    parts = (
        ("# MAVLink contract", INTRO),
        ("## What the vehicle sends", _table(("id", "message", "14540, Hz", "14550, Hz", "lockstep, Hz"), _sent())),
        ("Also sent:", _table(("message", "when"), ANSWERS.items())),
        ("## What it understands", _table(("id", "message", "what happens"), _understood())),
        ("## Commands", _table(("id", "command", "answer"), _commands())),
        ("## Understood, without effect", _table(("message", "why"), IDLE.items())),
        ("## Not sent", _table(("message", "why"), NOT_SENT.items())),
        ("## Everything else", REST),
        ("## Flight modes", _table(("custom_mode", "mode", "arms", "can be chosen in flight"), _modes())),
        ("## Parameters that change what it does", _params(HONOURED)),
        ("## Parameters that are only kept", _params(KEPT)),
    )
    return "\n".join(f"{title}\n\n{text.rstrip()}\n" for title, text in parts)


INTRO: Final = """\
What `swiftnav sitl` says and does as a PX4 v1.16 multicopter. This page is made by `make docs` from the vehicle's own
tables. COMMAND_LONG and COMMAND_INT are answered alike. Rates are those of the companion's and the ground
station's link and those of every link while a flight runs in lockstep; empty: on request only.
"""


def main() -> int:
    """Print the page."""
    sys.stdout.write(page())
    return 0


def _sent() -> Iterator[tuple[str, ...]]:
    for message_id in sorted(BUILDERS):
        rates = (table.get(message_id) for table in (ONBOARD_HZ, GCS_HZ, LEAN_HZ))
        yield (str(message_id), _name(message_id), *(f"{hz:g}" if hz is not None else "" for hz in rates))


def _understood() -> Iterator[tuple[str, ...]]:
    router = Router(Simulation(_nowhere()), 1)
    plans = MissionProtocol(MissionStore, lambda _text: None)
    known = {**router.handlers, **{i: _mission for i in mav.mavlink_map if plans.understands(i)}}
    for message_id in sorted(known):
        yield str(message_id), _name(message_id), _first_sentence(known[message_id])


def _mission(*_: Any) -> None:
    """Transfer of a mission (type 0), fence (1) or rally points (2)."""


def _commands() -> Iterator[tuple[str, ...]]:
    for number, handler in sorted(commands.HANDLERS.items()):
        entry = mav.enums["MAV_CMD"].get(number)
        yield str(number), entry.name.removeprefix("MAV_CMD_") if entry else "", _first_sentence(handler, whole=True)


def _modes() -> Iterator[tuple[str, ...]]:
    for mode, title in TITLES.items():
        yield str(int(mode)), title, _arms(mode), _flies(mode)


def _arms(mode: FlightMode) -> str:
    if mode is FlightMode.OFFBOARD:
        return "with setpoints"
    return "with sticks" if mode in MANUAL else "with a mission" * (mode is FlightMode.MISSION) or _yes(mode in ARMABLE)


def _flies(mode: FlightMode) -> str:
    if mode is FlightMode.OFFBOARD:
        return "with setpoints"
    return "with sticks" if mode in MANUAL else "with a mission" * (mode is FlightMode.MISSION) or _yes(mode in FLYABLE)


def _yes(statement: bool) -> str:
    return "yes" if statement else "no"


def _params(table: Mapping[str, Px4Param]) -> str:
    rows = (
        (name, "INT32" if isinstance(p.default, int) else "REAL32", f"{p.default:g}", p.unit, _range(p), p.text)
        for name, p in sorted(table.items())
    )
    return _table(("name", "type", "default", "unit", "range", "what"), rows)


def _range(param: Px4Param) -> str:
    if param.low is None and param.high is None:
        return ""
    low, high = ("" if limit is None else f"{limit:g}" for limit in (param.low, param.high))
    return f"{low} to {high}".strip()


def _name(message_id: int) -> str:
    kind = mav.mavlink_map.get(message_id)
    return str(kind.msgname) if kind is not None else NAMES[message_id]


def _first_sentence(told: Callable[..., Any], whole: bool = False) -> str:
    text = " ".join((told.__doc__ or "").split())
    return text if whole else re.split(r"(?<=\.) ", text)[0]


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _nowhere() -> World:
    return World("", np.zeros(2), np.array([5.0, 0.0]), (-9, -9, 9, 9), np.zeros((0, 4)), np.zeros((0, 6)))


if __name__ == "__main__":
    sys.exit(main())
