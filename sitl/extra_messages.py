"""How are messages sent that pymavlink's ``common`` dialect lacks? Each by its id, checksum seed and layout."""

import struct
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

PROTOCOL_VERSION_ID: Final = 300
_PROTOCOL_VERSION: Final = struct.Struct("<HHH8s8s")
_PROTOCOL_VERSION_SEED: Final = 217
MAVLINK_VERSION: Final = 200
MAVLINK_VERSION_MIN: Final = 100


class RawMessage(mav.MAVLink_message):  # type: ignore[misc]
    """An outgoing message whose payload is already bytes."""

    def __init__(self, message_id: int, name: str, seed: int, payload: bytes) -> None:
        super().__init__(message_id, name)
        self._seed = seed
        self._body = payload

    def pack(self, mavlink: Any, force_mavlink1: bool = False) -> bytes:
        """The packet, with the sequence number and ids of ``mavlink``."""
        packet: bytes = self._pack(mavlink, self._seed, self._body, force_mavlink1=force_mavlink1)
        return packet


def protocol_version() -> RawMessage:
    """PROTOCOL_VERSION: MAVLink 2, understands 1."""
    body = _PROTOCOL_VERSION.pack(MAVLINK_VERSION, MAVLINK_VERSION_MIN, MAVLINK_VERSION, bytes(8), bytes(8))
    return RawMessage(PROTOCOL_VERSION_ID, "PROTOCOL_VERSION", _PROTOCOL_VERSION_SEED, body)
