"""How far do the ranges scatter, and which hits do other scans refute? For gaps of centimetres; pure; local NED.

The minimum of several rays on one surface is nearer than the surface, by about a standard deviation of a ray, and now
and then by three; and it is said of a whole sector. Hits so far inside a gap close it until its cells are proven free
as a whole. So the scatter is read off the scans themselves and minima are taken back by it; a hit is not entered where
one of the last scans looks well past it, and a remembered one is dropped where this scan does.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from companion.core.gridmap import AZIMUTH_BINS, AZIMUTH_DIR, NEVER, GridMap, Lately, MapParams, PolarScan, update
from companion.core.types import F64

REACH_M = 1.8  # hits beyond this are left to the map
SCANS = 4  # besides the newest: one cycle of the LiDAR's dither
LEAST_M = 0.005  # past a hit: ranges come in whole centimetres
CAME_SIGMA = 3.0  # an arc that lies farther within what was seen free has come: it is no noise
NEAR_M = 1.5  # a sector beyond this is too wide to tell noise from shape
EVERY = 5  # bin of those with a hit: one a sector
LEAST_POINTS = 8
SIGMA_OF_QUARTILE = 0.45  # lower quartile of |difference| of two minima, to sigma: measured at 1 and 3 cm, 5 rays
STEP_M = 0.005  # of that quartile, what whole centimetres add
GAIN = 0.05  # of one scan


def entered(grid: GridMap, scan: PolarScan, unbias: float, refute: float, params: MapParams) -> GridMap:
    """The map after one more scan; as ``gridmap.update``, range noise reckoned with.

    Args:
        grid: before it.
        scan: laid flat.
        unbias: how many sigma of a ray minima are taken back by.
        refute: how many sigma past a hit a scan must look to refute it; 0: none does.
        params: of the map.
    """
    before = grid.lately
    sigma_m = _sigma_m(before, scan)
    scan_back = _moved_back(scan, unbias * sigma_m)
    margin_m = refute * sigma_m + LEAST_M
    pos_ne_m, free_m = scan.pos_ne_m[None], _narrowed(scan_back.free_m)
    if refute <= 0.0:
        return replace(update(grid, scan_back, params), lately=Lately(sigma_m, scan, pos_ne_m, free_m))
    taken = scan_back if before is None else _unrefuted(scan_back, before, margin_m, margin_m + CAME_SIGMA * sigma_m)
    grid = _without_refuted(update(grid, taken, params), pos_ne_m, free_m, margin_m)
    if before is not None:
        pos_ne_m = np.concatenate([pos_ne_m, before.pos_ne_m[: SCANS - 1]])
        free_m = np.concatenate([free_m, before.free_m[: SCANS - 1]])
    return replace(grid, lately=Lately(sigma_m, scan, pos_ne_m, free_m))


def _sigma_m(before: Lately | None, scan: PolarScan) -> float:
    """Standard deviation of a ray after one more scan: by how far this scan lies off the last one, near by."""
    if before is None:
        return 0.0
    some = np.arange(0, len(scan.hit_m), EVERY)
    some = some[scan.hit_m.take(some) < NEAR_M]
    if len(some) < LEAST_POINTS:
        return before.sigma_m
    last = before.scan
    off_m = np.abs(_past_m(_points(scan, some), last.pos_ne_m[None], last.free_m[None])[0])
    quarter = len(some) // 4
    quartile = float(np.partition(off_m, quarter)[quarter])
    sigma_m = math.sqrt(max(quartile * quartile - STEP_M * STEP_M, 0.0)) / SIGMA_OF_QUARTILE
    return before.sigma_m + GAIN * (sigma_m - before.sigma_m)


def _moved_back(scan: PolarScan, by_m: float) -> PolarScan:
    """The scan with every minimum that much farther away."""
    free_m = scan.free_m.copy()
    free_m[scan.hit_bin] += by_m
    return replace(scan, free_m=free_m, hit_m=scan.hit_m + by_m)


def _unrefuted(scan: PolarScan, before: Lately, margin_m: float, came_m: float) -> PolarScan:
    """The scan without the hits that the scans before look past.

    An arc all of which they look past is noise if it is so by less than ``came_m`` and the last scan does so too; else
    something has come, at once or little by little, and the whole of it stays.
    """
    near = (scan.hit_m < REACH_M).nonzero()[0]
    if len(near) == 0 or len(before.free_m) == 0:
        return scan
    past_m = _past_m(_points(scan, near), before.pos_ne_m, before.free_m)
    most_m, sector = past_m.max(axis=0), scan.hit_sector.take(near)
    begins = np.append(True, sector[1:] != sector[:-1])
    first = begins.nonzero()[0]
    least_m = np.minimum.reduceat(most_m, first)
    came = (least_m > margin_m) & ((least_m > came_m) | (np.minimum.reduceat(past_m[0], first) <= margin_m))
    kept = np.ones(len(scan.hit_m), bool)
    kept[near] = (most_m <= margin_m) | came.take(begins.cumsum() - 1)
    left = kept.nonzero()[0]
    return replace(
        scan, hit_bin=scan.hit_bin.take(left), hit_m=scan.hit_m.take(left), hit_sector=scan.hit_sector.take(left)
    )


def _without_refuted(grid: GridMap, pos_ne_m: F64, free_m: F64, margin_m: float) -> GridMap:
    """The map without the remembered hits that the scan from ``pos_ne_m`` (1, 2) looks past."""
    n, reach = len(grid.hit_t), math.ceil(REACH_M / grid.cell_m)
    places = zip(pos_ne_m[0].tolist(), grid.corner, strict=True)
    north, east = (max(math.floor(place_m / grid.cell_m) - corner - reach, 0) for place_m, corner in places)
    width = 2 * reach + 1
    known = grid.hit_t[north : north + width, east : east + width] > NEVER
    row, column = np.divmod(known.ravel().nonzero()[0], known.shape[1])
    cells = (row + north) * n + (column + east)
    hits = grid.hit_ne_m.reshape(-1, 2).take(cells, axis=0).astype(np.float64)
    hit_t = grid.hit_t.copy()
    hit_t.ravel()[cells[_past_m(hits, pos_ne_m, free_m)[0] > margin_m]] = NEVER
    return replace(grid, hit_t=hit_t)


def _points(scan: PolarScan, hits: NDArray[np.intp]) -> F64:
    points: F64 = AZIMUTH_DIR.take(scan.hit_bin.take(hits), axis=0)
    points *= scan.hit_m.take(hits)[:, None]
    points += scan.pos_ne_m
    return points


def _past_m(points_ne_m: F64, pos_ne_m: F64, free_m: F64) -> F64:
    """(scans, points) how far scans, of ``free_m`` (scans, bins) from ``pos_ne_m`` (scans, 2), look past points."""
    north = points_ne_m[:, 0] - pos_ne_m[:, 0, None]
    east = points_ne_m[:, 1] - pos_ne_m[:, 1, None]
    turns = np.arctan2(east, north)
    turns *= AZIMUTH_BINS / math.tau
    turns += AZIMUTH_BINS
    bins = turns.astype(np.intp)
    bins %= AZIMUTH_BINS
    bins += np.arange(0, free_m.size, AZIMUTH_BINS)[:, None]
    past: F64 = free_m.take(bins)
    past -= np.hypot(north, east)
    return past


def _narrowed(free_m: F64) -> F64:
    """(1, bins) the least of each bin and its neighbours: a hit lies anywhere in its bin."""
    ring = np.concatenate([free_m[-1:], free_m, free_m[:1]])
    narrowed: F64 = np.minimum(np.minimum(ring[2:], ring[:-2]), free_m)[None]
    return narrowed
