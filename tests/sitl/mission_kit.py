"""Mission items, and messages as they arrive: what the tests of missions share."""

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from sitl.geo import Origin
from sitl.mission_items import MissionItem
from sitl.world import World

ORIGIN = Origin()
NAN = math.nan


def open_world() -> World:
    return World("open", np.zeros(2), np.array([30.0, 0.0]), (-500, -500, 500, 500), np.zeros((0, 4)), np.zeros((0, 6)))


def place(
    north_m: float,
    east_m: float,
    height_m: float,
    command: int = mav.MAV_CMD_NAV_WAYPOINT,
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, NAN),
) -> MissionItem:
    """An item with a place, height above home."""
    lat_deg, lon_deg = ORIGIN.lat_lon_deg(north_m, east_m)
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    return MissionItem(frame, command, params, round(lat_deg * 1e7), round(lon_deg * 1e7), height_m)


def do(command: int, *params: float) -> MissionItem:
    """An item without a place."""
    p1, p2, p3, p4 = (*params, *[NAN] * (4 - len(params)))
    return MissionItem(mav.MAV_FRAME_MISSION, command, (p1, p2, p3, p4), 0, 0, NAN)


def item_int(seq: int, item: MissionItem, kind: int = 0, current: int = 0) -> Any:
    """The MISSION_ITEM_INT of an item."""
    return mav.MAVLink_mission_item_int_message(
        1, 1, seq, item.frame, item.command, current, 1, *item.params, item.x, item.y, item.z, kind
    )


def received(message: Any, system: int = 245, component: int = 190) -> Any:
    """The message as it comes out of the other end of a wire."""
    sender = mav.MAVLink(None, system, component)
    (back,) = mav.MAVLink(None).parse_buffer(message.pack(sender))
    return back
