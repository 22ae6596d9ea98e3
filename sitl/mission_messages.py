"""How do mission messages look on the wire, with the fields that pymavlink's dialect lacks (opaque ids)?"""

import struct
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.extra_messages import RawMessage
from sitl.mission_items import MissionItem

Message = Any  # a MAVLink_*_message object

_COUNT: Final = struct.Struct("<HBBBI")
_ACK: Final = struct.Struct("<BBBBI")
_CURRENT: Final = struct.Struct("<HHBBIII")
NO_ITEMS: Final = 65535  # MISSION_CURRENT.total of an empty mission
# PX4 names a mission's frames anew when it sends them: scaled ones in MISSION_ITEM_INT, the others in MISSION_ITEM.
_SCALED: Final = {
    mav.MAV_FRAME_GLOBAL: mav.MAV_FRAME_GLOBAL_INT,
    mav.MAV_FRAME_GLOBAL_RELATIVE_ALT: mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
}
_PLAIN: Final = {scaled: plain for plain, scaled in _SCALED.items()}


def count(target: tuple[int, int], number: int, kind: int, opaque_id: int) -> Message:
    """MISSION_COUNT."""
    body = _COUNT.pack(number, *target, kind, opaque_id)
    return RawMessage(mav.MAVLINK_MSG_ID_MISSION_COUNT, "MISSION_COUNT", 221, body)


def ack(target: tuple[int, int], result: int, kind: int, opaque_id: int = 0) -> Message:
    """MISSION_ACK."""
    return RawMessage(mav.MAVLINK_MSG_ID_MISSION_ACK, "MISSION_ACK", 153, _ACK.pack(*target, result, kind, opaque_id))


def current(seq: int, total: int, ids: tuple[int, int, int]) -> Message:
    """MISSION_CURRENT; state and mode are unknown (0), as PX4 v1.16 sends them. ``ids``: mission, fence, rally."""
    body = _CURRENT.pack(seq, total or NO_ITEMS, 0, 0, *ids)
    return RawMessage(mav.MAVLINK_MSG_ID_MISSION_CURRENT, "MISSION_CURRENT", 28, body)


def request(target: tuple[int, int], seq: int, kind: int) -> Message:
    """MISSION_REQUEST_INT."""
    return mav.MAVLink_mission_request_int_message(*target, seq, kind)


def reached(seq: int) -> Message:
    """MISSION_ITEM_REACHED."""
    return mav.MAVLink_mission_item_reached_message(seq)


def item(target: tuple[int, int], seq: int, entry: MissionItem, kind: int, is_current: bool, whole: bool) -> Message:
    """MISSION_ITEM_INT, or MISSION_ITEM for a client that asked with MISSION_REQUEST (``whole`` False)."""
    frame = (_SCALED if whole else _PLAIN).get(entry.frame, entry.frame)
    head = (*target, seq, frame, entry.command, int(is_current), int(entry.autocontinue), *entry.params)
    if whole:
        return mav.MAVLink_mission_item_int_message(*head, entry.x, entry.y, entry.z, kind)
    scale = 1.0 if entry.frame == mav.MAV_FRAME_MISSION else 1e-7
    return mav.MAVLink_mission_item_message(*head, entry.x * scale, entry.y * scale, entry.z, kind)
