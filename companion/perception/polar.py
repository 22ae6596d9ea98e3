"""Where do the ranges of a tilted scan lie over the ground? Pure; body plane in, horizontal local NED out.

The LiDAR turns with the body, so its plane tips with roll and pitch. A beam at bearing b in the body plane points along
P (cos b, sin b) over the ground, P the upper left 2 x 2 of the rotation ned from frd; its length there is the slant
range times |P (cos b, sin b)|. Beams that would meet the ground before their return prove less and hit nothing.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from companion.core.frames import rotation_ned_frd
from companion.core.gridmap import AZIMUTH_BINS, AZIMUTH_DIR, PolarScan
from companion.core.types import F64, Scan, VehicleState


@dataclass(frozen=True, slots=True)
class Flattened:
    """A scan laid flat: for the map per azimuth bin, for the score per fixed bearing."""

    polar: PolarScan
    bearing_range_m: F64  # (72,) horizontal range at fixed bearings 0, 5, .. deg off the nose; inf free, nan unknown


LEVEL = 1e-3  # a beam that falls less never meets the ground within range
BEARINGS = 72  # fixed bearings of the score, so that a dithered angle_offset does not move its weights
BEARING_RAD = np.arange(BEARINGS, dtype=np.float64) * (math.tau / BEARINGS)


def flatten(scan: Scan, state: VehicleState, lidar_up_m: float, ground_margin_m: float) -> Flattened:
    """Lay one scan flat.

    Args:
        scan: slant ranges in the body plane.
        state: pose at the scan's instant; local NED.
        lidar_up_m: height of the LiDAR above that position, plus the down of the ground in local NED.
        ground_margin_m: returns lower than this above the ground are the ground.
    """
    scan = _all_round(scan)
    rotation = rotation_ned_frd(state.q_ned_frd)
    ground_m = _ground_slant_m(
        scan, rotation, _trusted_height_m(lidar_up_m - float(state.pos_ned_m[2]), ground_margin_m)
    )
    hit = scan.range_m < ground_m  # false for nan and inf as well: inf < inf
    unknown = np.isnan(scan.range_m)
    proven_m = np.where(unknown, 0.0, np.minimum(np.minimum(scan.range_m, scan.range_max_m), ground_m))
    seen_m = np.where(hit | unknown, scan.range_m, np.inf)

    forward, right = _in_body_plane(rotation)
    stretch = 1.0 / np.hypot(forward, right)  # |P (cos b, sin b)|: horizontal metres per slant metre
    sector = _sector_of(np.arctan2(right, forward), scan)
    bins = hit.take(sector).nonzero()[0]
    horizontal_m = seen_m.take(sector) * stretch
    polar = PolarScan(
        t_s=scan.t_s,
        pos_ne_m=state.pos_ned_m[:2].copy(),
        free_m=proven_m.take(sector) * stretch,
        hit_bin=bins,
        hit_m=horizontal_m.take(bins),
        hit_sector=sector.take(bins),
    )
    return Flattened(polar, _at_bearings(horizontal_m, rotation))


def _all_round(scan: Scan) -> Scan:
    """The scan with unknown sectors where the sensor does not look."""
    missing = math.ceil(math.tau / scan.increment_rad - 1e-3) - len(scan.range_m)
    return scan if missing <= 0 else replace(scan, range_m=np.append(scan.range_m, np.full(missing, np.nan)))


def _in_body_plane(rotation: F64) -> tuple[F64, F64]:
    """The azimuth directions seen in the body plane, not normalised: P inverted and applied."""
    (a, b), (c, d) = rotation[:2, :2].tolist()
    determinant = a * d - b * c
    inverse = np.array([[d / determinant, -c / determinant], [-b / determinant, a / determinant]])  # transposed
    in_plane = AZIMUTH_DIR @ inverse
    return in_plane[:, 0], in_plane[:, 1]


def _sector_of(bearing_rad: F64 | np.float64, scan: Scan) -> NDArray[np.intp]:
    """Sector that holds each bearing, or the one."""
    first_edge = scan.angle_offset_rad - scan.increment_rad / 2
    turns = (bearing_rad - first_edge) * (1.0 / math.tau)
    turns -= np.floor(turns)
    turns *= math.tau / scan.increment_rad
    sector: NDArray[np.intp] = turns.astype(np.intp)
    sector *= sector < scan.range_m.shape[0]  # a full turn, by rounding, is sector 0
    return sector


def _trusted_height_m(height_m: float, margin_m: float) -> float:
    """Height that a beam may fall before its return could be the ground; half of it close to the ground."""
    return max(height_m - margin_m if height_m > 2.0 * margin_m else height_m / 2.0, 0.0)


def _ground_slant_m(scan: Scan, rotation: F64, height_m: float) -> F64:
    """Slant range (n,) from which a return of each sector may be the ground; inf for level and rising sectors."""
    n = scan.range_m.shape[0]
    forward, right = rotation[2, :2].tolist()
    most = math.hypot(forward, right)
    if most * scan.range_max_m < height_m:
        return np.full(n, np.inf)
    cosine, sine = _edges(n, scan.angle_offset_rad, scan.increment_rad)
    drop = forward * cosine + right * sine  # metres down per slant metre
    steepest = np.maximum(drop[:-1], drop[1:])
    steepest[_sector_of(np.float64(math.atan2(right, forward)), scan)] = most
    slant_m: F64 = height_m / np.maximum(steepest, LEVEL)
    slant_m[steepest <= LEVEL] = np.inf
    return slant_m


@lru_cache(maxsize=32)
def _edges(n: int, angle_offset_rad: float, increment_rad: float) -> tuple[F64, F64]:
    """Cosine and sine (n + 1,) of the bearings between the sectors."""
    edge = angle_offset_rad + (np.arange(n + 1) - 0.5) * increment_rad
    return np.cos(edge), np.sin(edge)


def _at_bearings(horizontal_m: F64, rotation: F64) -> F64:
    """Ranges at the fixed bearings off the nose."""
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    bins = ((BEARING_RAD + (yaw + math.tau)) * (AZIMUTH_BINS / math.tau)).astype(np.intp)
    return horizontal_m.take(bins, mode="wrap")
