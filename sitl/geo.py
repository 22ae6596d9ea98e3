"""Where on the globe is a local position? PX4's map projection (azimuthal equidistant on a sphere); pure."""

import math
from dataclasses import dataclass
from typing import Final

EARTH_RADIUS_M: Final = 6371000.0  # CONSTANTS_RADIUS_OF_EARTH


@dataclass(frozen=True, slots=True)
class Origin:
    """Where local ned has its origin; the default is PX4's home in Zurich."""

    lat_deg: float = 47.397742
    lon_deg: float = 8.545594
    alt_amsl_m: float = 489.4

    def lat_lon_deg(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude of a local position."""
        arc = math.hypot(north_m, east_m) / EARTH_RADIUS_M
        if arc == 0.0:
            return self.lat_deg, self.lon_deg
        lat0, lon0 = math.radians(self.lat_deg), math.radians(self.lon_deg)
        n, e = north_m / EARTH_RADIUS_M / arc, east_m / EARTH_RADIUS_M / arc
        lat = math.asin(math.cos(arc) * math.sin(lat0) + n * math.sin(arc) * math.cos(lat0))
        lon = lon0 + math.atan2(e * math.sin(arc), math.cos(lat0) * math.cos(arc) - n * math.sin(lat0) * math.sin(arc))
        return math.degrees(lat), math.degrees(lon)

    def alt_m(self, down_m: float) -> float:
        """Altitude above mean sea level of a local ``down_m``."""
        return self.alt_amsl_m - down_m

    def down_m(self, alt_amsl_m: float) -> float:
        """Local ``down_m`` of an altitude above mean sea level."""
        return self.alt_amsl_m - alt_amsl_m

    def north_east_m(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Local position of a latitude and longitude: the inverse of ``lat_lon_deg``."""
        lat0, lat = math.radians(self.lat_deg), math.radians(lat_deg)
        turn = math.radians(lon_deg - self.lon_deg)
        cos_arc = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(turn)
        north = math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(turn)
        east = math.cos(lat) * math.sin(turn)
        sin_arc = math.hypot(north, east)
        arc = math.atan2(sin_arc, cos_arc)
        scale_m = EARTH_RADIUS_M * (arc / sin_arc if sin_arc > 0.0 else 1.0)
        return north * scale_m, east * scale_m
