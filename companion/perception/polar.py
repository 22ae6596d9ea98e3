"""Where do the ranges of a tilted scan lie over the ground? Pure; body plane in, horizontal local NED out.

The LiDAR turns with the body, so its plane tips with roll and pitch. A beam at bearing b in the body plane points along
P (cos b, sin b) over the ground, P the upper left 2 x 2 of the rotation ned from frd; its length there is the slant
range times |P (cos b, sin b)|. Beams that would meet the ground before their return prove less and hit nothing.
"""

import math
from dataclasses import dataclass

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


BEARINGS = 72  # fixed bearings of the score, so that a dithered angle_offset does not move its weights
BEARING_RAD = np.arange(BEARINGS, dtype=np.float64) * (math.tau / BEARINGS)


def flatten(scan: Scan, state: VehicleState, ground_margin_m: float) -> Flattened:
    """Lay one scan flat.

    Args:
        scan: slant ranges in the body plane.
        state: pose at the scan's instant; local NED, ground at down = 0.
        ground_margin_m: returns lower than this above the ground are the ground.
    """
    rotation = rotation_ned_frd(state.q_ned_frd)
    plane = rotation[:2, :2]
    body = AZIMUTH_DIR @ np.linalg.inv(plane).T  # azimuth directions seen in the body plane, not normalised
    stretch = 1.0 / np.sqrt(np.einsum("ij,ij->i", body, body))  # |P (cos b, sin b)|: horizontal metres per slant metre
    bearing = np.arctan2(body[:, 1], body[:, 0])
    sector = _sector_of(bearing, scan)
    horizontal = scan.range_m[sector] * stretch

    drop = (body @ rotation[2, :2]) * stretch  # metres down per slant metre
    height = -float(state.pos_ned_m[2])
    ground_m = _ground_range_m(drop / stretch, height - ground_margin_m)
    hit = np.isfinite(horizontal) & (horizontal < ground_m)
    free_m = np.where(
        np.isnan(horizontal), 0.0, np.minimum(np.minimum(horizontal, scan.range_max_m * stretch), ground_m)
    )
    bins = np.flatnonzero(hit).astype(np.int32)
    polar = PolarScan(
        scan.t_s, state.pos_ned_m[:2].copy(), free_m, bins, horizontal[bins], sector[bins].astype(np.int32)
    )
    return Flattened(polar, _at_bearings(horizontal, hit, rotation))


def _sector_of(bearing_rad: F64, scan: Scan) -> NDArray[np.intp]:
    """Sector that holds each bearing."""
    n = scan.range_m.shape[0]
    first_edge = scan.angle_offset_rad - scan.increment_rad / 2
    turns = (bearing_rad - first_edge) * (1.0 / math.tau)
    sector: NDArray[np.intp] = ((turns - np.floor(turns)) * (math.tau / scan.increment_rad)).astype(np.intp) % n
    return sector


def _ground_range_m(drop_per_m: F64, height_m: float) -> F64:
    """Horizontal range at which beams reach the ground margin; inf for level and rising ones."""
    if height_m <= 0.0:  # standing on the ground: a level plane never meets it, a tipped one is not believed
        return np.where(drop_per_m > np.sin(np.radians(3.0)), 0.0, np.inf)
    falling = drop_per_m > 1e-6
    return np.where(falling, height_m / np.where(falling, drop_per_m, 1.0), np.inf)


def _at_bearings(horizontal_m: F64, hit: NDArray[np.bool_], rotation: F64) -> F64:
    """Horizontal range at the fixed bearings off the nose; ground returns count as free."""
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    bins = np.floor(((BEARING_RAD + yaw) % math.tau) * (AZIMUTH_BINS / math.tau)).astype(np.int64) % AZIMUTH_BINS
    ranges: F64 = np.where(np.isnan(horizontal_m), np.nan, np.where(hit, horizontal_m, np.inf))[bins]
    return ranges
