"""How are an autopilot's own parameters read? PX4 puts an integer's bits into the float field. Pure."""

import struct
from typing import Any

from pymavlink.dialects.v20 import common as mav

from companion.core import codec

Message = Any  # a MAVLink_*_message object

BY_NAME = -1  # param_index of a request by name
INTEGERS = (mav.MAV_PARAM_TYPE_INT32, mav.MAV_PARAM_TYPE_UINT32)


def encode_param_request(name: str, target_system: int) -> Message:
    """PARAM_REQUEST_READ of one parameter of the autopilot."""
    return mav.MAVLink_param_request_read_message(target_system, codec.VEHICLE_COMPONENT, name.encode("ascii"), BY_NAME)


def decode_param(message: Message) -> tuple[str, float]:
    """Name and value of a PARAM_VALUE."""
    raw = message.param_id
    name = raw.decode("ascii", "replace") if isinstance(raw, bytes) else str(raw)
    value = message.param_value
    if message.param_type in INTEGERS:
        value = struct.unpack("<i", struct.pack("<f", value))[0]
    return name.split("\0", 1)[0], float(value)
