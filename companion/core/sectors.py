"""How does a scan of many rays become few sectors? Pure; body frd."""

import dataclasses
import math
from typing import Final

import numpy as np

from companion.core.types import Scan

SECTORS: Final = 72  # length of OBSTACLE_DISTANCE.distances
BORDER_TOLERANCE: Final = 1e-9  # of a ray: rounding must not pull the neighbouring ray in


def bin_scan(scan: Scan, sectors: int = SECTORS) -> Scan:
    """At most ``sectors`` sectors; each new one reports the nearest hit of the rays that it overlaps.

    A ray that straddles a border counts for both sides. A sector without a hit is free when at least half of its rays
    measured, else unknown.
    """
    count = len(scan.range_m)
    if count <= sectors:
        return scan
    ratio = count / sectors
    nearest_m = np.empty(sectors)
    for i in range(sectors):
        first = math.floor(i * ratio + BORDER_TOLERANCE)
        past = math.ceil((i + 1) * ratio - BORDER_TOLERANCE)
        nearest_m[i] = _nearest(scan.range_m[first:past].tolist())
    return dataclasses.replace(
        scan,
        range_m=nearest_m,
        angle_offset_rad=scan.angle_offset_rad + (ratio - 1) / 2 * scan.increment_rad,
        increment_rad=scan.increment_rad * ratio,
    )


def _nearest(rays_m: list[float]) -> float:
    measured = [ray_m for ray_m in rays_m if not math.isnan(ray_m)]
    nearest_m = min(measured, default=math.nan)
    if math.isinf(nearest_m) and 2 * len(measured) < len(rays_m):
        return math.nan
    return nearest_m
