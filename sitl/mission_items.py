"""What is a mission item, and which does PX4 take? Values and PX4 v1.16's checks on upload; pure.

The same value carries way points, fence vertices and rally points (mission types 0, 1, 2). ``x`` and ``y`` are as on
the wire: degrees times 1e7, or parameters 5 and 6 of a command without a place.
"""

import math
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

Message = Any  # a MAVLink_*_message object

NO_PLACE: Final = 0x7FFFFFFF  # x or y that says "where the vehicle is"
DEG_E7: Final = 1e-7

ABSOLUTE: Final = frozenset({mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT})
RELATIVE: Final = frozenset({mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})

POLYGONS: Final = frozenset(
    {mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION}
)
CIRCLES: Final = frozenset({mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION})
FENCE: Final = POLYGONS | CIRCLES
NOT_IN_MISSION: Final = FENCE | {mav.MAV_CMD_NAV_RALLY_POINT}
_ROI: Final = frozenset({mav.MAV_CMD_NAV_ROI, mav.MAV_CMD_DO_SET_ROI})

# Places that a mission flies to.
FLOWN_TO: Final = frozenset(
    {
        mav.MAV_CMD_NAV_WAYPOINT,
        mav.MAV_CMD_NAV_LOITER_UNLIM,
        mav.MAV_CMD_NAV_LOITER_TIME,
        mav.MAV_CMD_NAV_LOITER_TO_ALT,
        mav.MAV_CMD_NAV_TAKEOFF,
        mav.MAV_CMD_NAV_LAND,
        mav.MAV_CMD_NAV_VTOL_TAKEOFF,
        mav.MAV_CMD_NAV_VTOL_LAND,
    }
)
_WITH_PLACE: Final = (
    FLOWN_TO
    | NOT_IN_MISSION
    | _ROI
    | {
        mav.MAV_CMD_DO_SET_ROI_LOCATION,
        mav.MAV_CMD_CONDITION_GATE,
        mav.MAV_CMD_NAV_FENCE_RETURN_POINT,
        mav.MAV_CMD_COMPONENT_ARM_DISARM,
        mav.MAV_CMD_DO_AUTOTUNE_ENABLE,
    }
)
_WITHOUT_PLACE: Final = _ROI | {
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mav.MAV_CMD_NAV_DELAY,
    mav.MAV_CMD_CONDITION_DELAY,
    mav.MAV_CMD_CONDITION_DISTANCE,
    mav.MAV_CMD_COMPONENT_ARM_DISARM,
    mav.MAV_CMD_DO_JUMP,
    mav.MAV_CMD_DO_CHANGE_SPEED,
    mav.MAV_CMD_DO_SET_HOME,
    mav.MAV_CMD_DO_LAND_START,
    mav.MAV_CMD_DO_SET_ACTUATOR,
    mav.MAV_CMD_DO_AUTOTUNE_ENABLE,
    mav.MAV_CMD_DO_VTOL_TRANSITION,
    mav.MAV_CMD_DO_WINCH,
    mav.MAV_CMD_DO_GRIPPER,
    mav.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
    mav.MAV_CMD_DO_SET_ROI_NONE,
    # cameras and gimbals: taken and passed over
    mav.MAV_CMD_DO_TRIGGER_CONTROL,
    mav.MAV_CMD_DO_DIGICAM_CONTROL,
    mav.MAV_CMD_DO_MOUNT_CONFIGURE,
    mav.MAV_CMD_DO_MOUNT_CONTROL,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
    mav.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
    mav.MAV_CMD_IMAGE_START_CAPTURE,
    mav.MAV_CMD_IMAGE_STOP_CAPTURE,
    mav.MAV_CMD_VIDEO_START_CAPTURE,
    mav.MAV_CMD_VIDEO_STOP_CAPTURE,
    mav.MAV_CMD_DO_CONTROL_VIDEO,
    mav.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    mav.MAV_CMD_DO_SET_CAM_TRIGG_INTERVAL,
    mav.MAV_CMD_OBLIQUE_SURVEY,
    mav.MAV_CMD_SET_CAMERA_MODE,
    mav.MAV_CMD_SET_CAMERA_ZOOM,
    mav.MAV_CMD_SET_CAMERA_FOCUS,
}
_ROI_WITH_PLACE: Final = (mav.MAV_ROI_LOCATION, mav.MAV_ROI_NONE)
_ROI_WITHOUT: Final = (mav.MAV_ROI_NONE, mav.MAV_ROI_WPNEXT, mav.MAV_ROI_WPINDEX)


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which list."""

    MISSION = mav.MAV_MISSION_TYPE_MISSION
    FENCE = mav.MAV_MISSION_TYPE_FENCE
    RALLY = mav.MAV_MISSION_TYPE_RALLY


MAX_ITEMS: Final = {MissionType.MISSION: 2000, MissionType.FENCE: 1500, MissionType.RALLY: 100}  # PX4 on a desk


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One entry of a list; parameters 1 to 4 may be NaN."""

    frame: int
    command: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: bool = True

    @property
    def has_place(self) -> bool:
        """Is it flown to?"""
        return self.command in FLOWN_TO

    @property
    def lat_lon_deg(self) -> tuple[float, float] | None:
        """Where; None for "here" (the wire's way to say so, or 0, 0)."""
        if NO_PLACE in (self.x, self.y) or (self.x == 0 and self.y == 0):
            return None
        return self.x * DEG_E7, self.y * DEG_E7


def from_message(message: Message) -> MissionItem:
    """The item of a MISSION_ITEM_INT, or of a MISSION_ITEM (whose x and y are degrees). Raises ValueError."""
    m = message
    x, y = m.x, m.y
    if m.get_msgId() == mav.MAVLINK_MSG_ID_MISSION_ITEM:
        scale = 1.0 if m.frame == mav.MAV_FRAME_MISSION else 1.0 / DEG_E7
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError("x and y are no numbers")
        x, y = round(x * scale), round(y * scale)
    return MissionItem(m.frame, m.command, (m.param1, m.param2, m.param3, m.param4), x, y, m.z, bool(m.autocontinue))


def verdict(item: MissionItem, kind: MissionType) -> int:
    """MAV_MISSION_RESULT of one uploaded item, as PX4 judges it."""
    placed = item.frame in ABSOLUTE or item.frame in RELATIVE
    if not placed and item.frame != mav.MAV_FRAME_MISSION:
        return int(mav.MAV_MISSION_UNSUPPORTED_FRAME)
    if item.command not in (_WITH_PLACE if placed else _WITHOUT_PLACE):
        return int(mav.MAV_MISSION_UNSUPPORTED)
    if item.command in _ROI and item.params[0] not in (_ROI_WITH_PLACE if placed else _ROI_WITHOUT):
        return int(mav.MAV_MISSION_INVALID_PARAM1)
    if kind is MissionType.MISSION and item.command in NOT_IN_MISSION:
        return int(mav.MAV_MISSION_ERROR)
    if kind is MissionType.FENCE and item.command in POLYGONS and not item.params[0] >= 2.5:
        return int(mav.MAV_MISSION_ERROR)  # rounds to fewer than three vertices
    return int(mav.MAV_MISSION_ACCEPTED)


def opaque_id(items: Iterable[MissionItem]) -> int:
    """The id that tells lists apart: a CRC over all items, 0 for an empty list."""
    crc = 0
    for item in items:
        packed = struct.pack(
            "<BHB4fiif", item.frame, item.command, item.autocontinue, *item.params, item.x, item.y, item.z
        )
        crc = zlib.crc32(packed, crc)
    return crc
