"""Can this mission be flown? PX4's feasibility checks with their texts; pure; local ned."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from sitl.geo import Origin
from sitl.geofence import Geofence
from sitl.home import Home
from sitl.mission_items import RELATIVE, MissionItem
from sitl.px4_params import ParamStore

ABOVE_RADIUS_M: Final = 1.0  # a take-off goes at least this much higher than its acceptance radius


def down_m(item: MissionItem, origin: Origin, home: Home) -> float:
    """Local ``down_m`` of an item."""
    return home.down_m - item.z if item.frame in RELATIVE else origin.down_m(item.z)


@dataclass(frozen=True, slots=True)
class Place:
    """Where the vehicle stands when it is asked to fly."""

    origin: Origin
    home: Home
    fence: Geofence
    landed: bool


def objection(items: Sequence[MissionItem], place: Place, params: ParamStore) -> str | None:
    """Why PX4 rejects the mission; None: it can be flown."""
    if place.landed and items and items[0].command == mav.MAV_CMD_NAV_LAND:
        return "Mission rejected: starts with landing"
    placed = [(at, item) for at, item in enumerate(items) if item.has_place]
    for number, (at, item) in enumerate(placed):
        if not math.isfinite(item.z):
            return f"Mission rejected: item {at + 1}: altitude is no number"
        if item.command == mav.MAV_CMD_NAV_TAKEOFF:
            radius_m = item.params[1] if item.params[1] > 0.0 else params["NAV_ACC_RAD"]
            if not place.home.down_m - down_m(item, place.origin, place.home) - ABOVE_RADIUS_M >= radius_m:
                return "Mission rejected: Takeoff altitude too low!"
            if number > 0:
                return "Mission rejected: takeoff not first waypoint item"
        where = item.lat_lon_deg
        if where is None:
            continue
        north_m, east_m = place.origin.north_east_m(*where)
        from_home = np.array([north_m, east_m]) - place.home.pos_ned_m[:2]
        away_m, far_m = float(np.hypot(*from_home)), float(params["MIS_DIST_1WP"])
        if number == 0 and 0.0 < far_m < away_m:
            return f"First waypoint too far away: {away_m:.0f}m, {far_m:.0f} max"
        if not place.fence.allows(north_m, east_m):
            return f"Geofence violation for waypoint {at + 1}"
    return None
