"""May the vehicle be here? Areas to stay in or out of, greatest distance and height: PX4's geofence; pure; local ned.

An area that home violates is dropped when it is uploaded, as is one that the flying vehicle violates at that moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.types import F64
from sitl.geo import Origin
from sitl.mission_items import CIRCLES, POLYGONS, MissionItem
from sitl.px4_params import ParamStore

INCLUSION: Final = frozenset({mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION})
NOT_AT_HOME: Final = "Geofence invalid, doesn't contain Home position"
NOT_HERE: Final = "Geofence invalid, doesn't contain current vehicle position"


class Breach(Enum):
    """What is violated; the value is what PX4 says."""

    DISTANCE = "Geofence: exceeding maximum distance to Home"
    ALTITUDE = "Geofence: exceeding maximum altitude above Home"
    AREA = "Geofence: approaching or outside geofence"


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """A polygon (``vertices_ne_m``), or a circle around its only vertex."""

    inclusion: bool
    vertices_ne_m: F64  # (n, 2)
    radius_m: float | None = None

    def allows(self, north_m: float, east_m: float) -> bool:
        """May a vehicle be at this place?"""
        inside = self._in_circle(north_m, east_m) if self.radius_m is not None else self._in_polygon(north_m, east_m)
        return inside is self.inclusion

    def _in_circle(self, north_m: float, east_m: float) -> bool:
        away = self.vertices_ne_m[0] - (north_m, east_m)
        return bool(np.hypot(*away) < self.radius_m)

    def _in_polygon(self, north_m: float, east_m: float) -> bool:
        """Crossings of a ray to the north (W. R. Franklin's test)."""
        n, e = self.vertices_ne_m.T
        n_before, e_before = np.roll(n, 1), np.roll(e, 1)
        straddles = (e >= east_m) != (e_before >= east_m)
        span = np.where(straddles, e_before - e, 1.0)
        crossing_m = (n_before - n) * (east_m - e) / span + n
        return bool(np.count_nonzero(straddles & (north_m <= crossing_m)) % 2)


@dataclass(frozen=True, slots=True)
class Geofence:
    """Every area must allow a place."""

    areas: tuple[Area, ...] = ()

    def allows(self, north_m: float, east_m: float) -> bool:
        """May a vehicle be at this place, as far as the areas go?"""
        return all(area.allows(north_m, east_m) for area in self.areas)

    def breach(self, pos_ned_m: F64, home_ned_m: F64, params: ParamStore) -> Breach | None:
        """What a vehicle at ``pos_ned_m`` violates."""
        north_m, east_m, down_m = (pos_ned_m - home_ned_m).tolist()
        far_m, high_m = params["GF_MAX_HOR_DIST"], params["GF_MAX_VER_DIST"]
        if far_m > 0.0 and not np.hypot(north_m, east_m) < far_m:
            return Breach.DISTANCE
        if high_m > 0.0 and not -down_m < high_m:
            return Breach.ALTITUDE
        return None if self.allows(float(pos_ned_m[0]), float(pos_ned_m[1])) else Breach.AREA


def areas_of(items: Sequence[MissionItem], origin: Origin) -> tuple[Area, ...]:
    """The areas of an uploaded fence. A polygon that lacks vertices ends with the list."""
    areas, at = [], 0
    while at < len(items):
        item = items[at]
        inclusion = item.command in INCLUSION
        if item.command in CIRCLES:
            areas.append(Area(inclusion, _places(items[at : at + 1], origin), item.params[0]))
        elif item.command in POLYGONS:
            vertices = items[at : at + int(item.params[0] + 0.5)]
            areas.append(Area(inclusion, _places(vertices, origin)))
            at += len(vertices) - 1
        at += 1
    return tuple(areas)


def accept(areas: Sequence[Area], home_ned_m: F64, here_ned_m: F64 | None) -> tuple[Geofence, tuple[str, ...]]:
    """The fence of those areas that hold at home and, in flight, ``here_ned_m``; and what PX4 says about the others."""
    kept, texts = [], []
    for area in areas:
        if not area.allows(float(home_ned_m[0]), float(home_ned_m[1])):
            texts.append(NOT_AT_HOME)
        elif here_ned_m is not None and not area.allows(float(here_ned_m[0]), float(here_ned_m[1])):
            texts.append(NOT_HERE)
        else:
            kept.append(area)
    return Geofence(tuple(kept)), tuple(texts)


def _places(items: Sequence[MissionItem], origin: Origin) -> F64:
    return np.array([origin.north_east_m(item.x * 1e-7, item.y * 1e-7) for item in items])
