"""What scan do the rays of one revolution make? Pure; bearings frd (0 nose, right positive)."""

import math
from typing import Final

import numpy as np

from companion.core.sectors import SECTORS
from companion.core.types import F64, Scan
from companion.link.lidar_params import LidarParams

INCREMENT_RAD: Final = 2 * math.pi / SECTORS
# Sector borders move from sweep to sweep, so that the map learns where inside a sector a hit is; as sitl's LiDAR does.
DITHER_RAD: Final = tuple(math.radians(degrees) for degrees in (0.0, 2.0, 4.0, 1.0, 3.0))


def bearings(angle_rad: F64, params: LidarParams) -> F64:
    """Bearings of angles as the LiDAR counts them, in [0, 2 pi)."""
    turned = angle_rad if params.clockwise else -angle_rad
    wrapped: F64 = np.mod(turned + params.mount_yaw_rad, 2 * math.pi)
    return wrapped


def ranges(measured_m: F64, params: LidarParams) -> F64:
    """Ranges in the sense of ``Scan``; 0 is a ray without a return."""
    range_m = np.where(measured_m > params.range_max_m, math.inf, measured_m)
    range_m[measured_m < params.range_min_m] = math.nan
    range_m[measured_m == 0.0] = math.inf if params.no_return_free else math.nan
    return range_m


def scan_of(t_s: float, angle_rad: F64, measured_m: F64, params: LidarParams, number: int = 0) -> Scan:
    """Sector minima of one revolution, ``number`` in the row of dithered ones.

    A sector without a hit is free when at least half of its rays are, unknown otherwise and without any ray.
    """
    offset_rad = DITHER_RAD[number % len(DITHER_RAD)]
    sector = np.rint((bearings(angle_rad, params) - offset_rad) / INCREMENT_RAD).astype(np.intp) % SECTORS
    range_m = ranges(measured_m, params)
    rays = np.bincount(sector, minlength=SECTORS)
    free = np.bincount(sector, weights=np.isposinf(range_m), minlength=SECTORS)
    nearest_m = np.where((rays > 0) & (2 * free >= rays), math.inf, math.nan)
    hit = np.isfinite(range_m)
    nearest_hit_m = np.full(SECTORS, math.inf)
    np.minimum.at(nearest_hit_m, sector[hit], range_m[hit])
    struck = np.isfinite(nearest_hit_m)
    nearest_m[struck] = nearest_hit_m[struck]
    return Scan(t_s, nearest_m, offset_rad, INCREMENT_RAD, params.range_min_m, params.range_max_m)
