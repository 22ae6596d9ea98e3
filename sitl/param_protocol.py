"""How are PX4's parameters read and written over MAVLink? Bytewise encoding: an INT32 is a float with the same bits."""

import struct
import zlib
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

NO_INDEX: Final = 65535
HASH_CHECK: Final = "_HASH_CHECK"  # one number for all values: a client that knows it need not ask for them


def encode(value: int | float) -> tuple[float, int]:
    """param_value and param_type."""
    if isinstance(value, int):
        return float(struct.unpack("<f", struct.pack("<i", value))[0]), mav.MAV_PARAM_TYPE_INT32
    return value, mav.MAV_PARAM_TYPE_REAL32


def decode(param_value: float, param_type: int) -> int | float | None:
    """The value; None for a type that PX4 does not use."""
    if param_type == mav.MAV_PARAM_TYPE_INT32:
        return int(struct.unpack("<i", struct.pack("<f", param_value))[0])
    return param_value if param_type == mav.MAV_PARAM_TYPE_REAL32 else None


def read_all(sim: Simulation) -> list[Message]:
    """PARAM_VALUE of everything, for PARAM_REQUEST_LIST."""
    return [hash_check(sim), *(_value(sim, name) for name in sim.autopilot.params.names())]


def hash_check(sim: Simulation) -> Message:
    """PARAM_VALUE of _HASH_CHECK: a checksum over all names and values."""
    params = sim.autopilot.params
    names, checksum = params.names(), 0
    for name in names:
        checksum = zlib.crc32(name.encode() + struct.pack("<f", encode(params[name])[0]), checksum)
    value = struct.unpack("<f", struct.pack("<I", checksum))[0]
    return mav.MAVLink_param_value_message(HASH_CHECK.encode(), value, mav.MAV_PARAM_TYPE_UINT32, len(names), NO_INDEX)


def read(message: Message, sim: Simulation) -> list[Message]:
    """The answer to PARAM_REQUEST_READ; silence, as PX4 has it, for what is not there."""
    names = sim.autopilot.params.names()
    if message.param_index >= 0:
        return [_value(sim, names[message.param_index])] if message.param_index < len(names) else []
    name = param_name(message)
    if name == HASH_CHECK:
        return [hash_check(sim)]
    return [_value(sim, name)] if name in sim.autopilot.params else []


def write(message: Message, sim: Simulation) -> list[Message]:
    """The answer to PARAM_SET: the value now in force, or silence for an unknown name, wrong type or NaN."""
    name, value = param_name(message), decode(message.param_value, message.param_type)
    if name not in sim.autopilot.params or type(value) is not type(sim.autopilot.params[name]):
        return []
    try:
        sim.set_parameter(name, value)
    except ValueError:
        return []
    return [_value(sim, name)]


def param_name(message: Message) -> str:
    """The id of a parameter message, as pymavlink decoded it (text or bytes, padded or not)."""
    raw = message.param_id
    text = raw.decode("ascii", "replace") if isinstance(raw, bytes) else str(raw)
    return text.split("\0", 1)[0]


def _value(sim: Simulation, name: str) -> Message:
    names = sim.autopilot.params.names()
    value, kind = encode(sim.autopilot.params[name])
    return mav.MAVLink_param_value_message(name.encode(), value, kind, len(names), names.index(name))
