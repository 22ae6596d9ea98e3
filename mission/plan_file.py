"""What does a QGroundControl ``.plan`` ask for?  The last waypoint is the goal, relative to the planned home.

Latitude and longitude become metres on the plane that touches WGS84 at the planned home: north = dlat * (M + h),
east = dlon * (N + h) * cos(lat0), with the meridian and prime-vertical radii M, N at the home's latitude. Over the
kilometre that a flight spans the plane is wrong by less than 0.1 m.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mission.errors import InputError

WGS84_A_M = 6378137.0  # semi-major axis (NIMA TR8350.2)
WGS84_E2 = 6.69437999014e-3  # first eccentricity squared
MAV_CMD_NAV_WAYPOINT = 16
MAV_CMD_NAV_LAND = 21
MAV_FRAME_GLOBAL_RELATIVE_ALT = (3, 6)
TIME_LIMIT_BASE_S = 30.0  # take-off, landing and disarming
TIME_LIMIT_FACTOR = 3.0  # of the straight line at the plan's speed


@dataclass(frozen=True, slots=True)
class Plan:
    """The part of a plan that a point-to-point flight uses; NED relative to the planned home."""

    goal_ned_m: tuple[float, float]
    down_m: float | None
    speed_m_s: float
    time_limit_s: float


def read_plan(path: Path) -> Plan:
    """The goal of a ``.plan`` file. Raises InputError."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(f"{path}: not JSON: {error}") from error
    if not isinstance(data, dict) or data.get("fileType") != "Plan" or not isinstance(data.get("mission"), dict):
        raise InputError(f"{path}: not a QGroundControl plan (fileType is not 'Plan')")
    mission = data["mission"]
    home = _numbers(mission.get("plannedHomePosition"), 3, f"{path}: plannedHomePosition")
    item = _last_waypoint(mission.get("items"), path)
    where = _numbers(item["params"][4:7], 3, f"{path}: coordinates of the last waypoint")
    goal = flat_earth_ned_m((home[0], home[1]), home[2], (where[0], where[1]))
    relative = item.get("frame") in MAV_FRAME_GLOBAL_RELATIVE_ALT
    height_m = where[2] if relative else where[2] - home[2]
    speed_m_s = _numbers([mission.get("hoverSpeed")], 1, f"{path}: hoverSpeed")[0]
    if speed_m_s <= 0.0:
        raise InputError(f"{path}: hoverSpeed = {speed_m_s} is not above 0")
    limit_s = TIME_LIMIT_BASE_S + TIME_LIMIT_FACTOR * math.hypot(*goal) / speed_m_s
    down_m = -height_m if item["command"] == MAV_CMD_NAV_WAYPOINT else None
    return Plan(goal, down_m, speed_m_s, limit_s)


def flat_earth_ned_m(
    home_deg: tuple[float, float], home_alt_m: float, point_deg: tuple[float, float]
) -> tuple[float, float]:
    """(north, east) of a (latitude, longitude) from home; see the module's text for the formula."""
    lat_rad = math.radians(home_deg[0])
    curvature = 1.0 - WGS84_E2 * math.sin(lat_rad) ** 2
    meridian_m = WGS84_A_M * (1.0 - WGS84_E2) / curvature**1.5
    prime_vertical_m = WGS84_A_M / math.sqrt(curvature)
    dlon_deg = math.remainder(point_deg[1] - home_deg[1], 360.0)
    north_m = math.radians(point_deg[0] - home_deg[0]) * (meridian_m + home_alt_m)
    return north_m, math.radians(dlon_deg) * (prime_vertical_m + home_alt_m) * math.cos(lat_rad)


def _last_waypoint(items: Any, path: Path) -> dict[str, Any]:
    wanted = (MAV_CMD_NAV_WAYPOINT, MAV_CMD_NAV_LAND)
    if isinstance(items, list):
        for item in reversed(items):
            if isinstance(item, dict) and item.get("command") in wanted and len(item.get("params") or []) == 7:
                return item
    raise InputError(f"{path}: has no waypoint to fly to")


def _numbers(values: Any, count: int, what: str) -> list[float]:
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{what}: wants {count} numbers, got {values!r}")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{what}: wants {count} finite numbers, got {values!r}")
    return [float(value) for value in values]
