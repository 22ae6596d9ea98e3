"""What has been proven free, and where has something been hit? A rolling map in local NED; a value, pure updates.

A sector minimum is two statements: the wedge nearer than it is *proven free*, and the surface lies *somewhere* on the
arc at that range. So a hit may only occupy cells that were not certified free lately; wedges of successive scans
intersect and the map becomes sharper than one sector. Where a whole arc was certified free, something has moved there:
all of it is painted. Certification clears a hit at once, so what moves is forgotten fast; what is not seen again ages.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from companion.core.params import param
from companion.core.types import F64

F32 = NDArray[np.float32]
Index = NDArray[np.intp]

AZIMUTH_BINS = 360  # 1 deg: 24 cm at 14 m, about a cell
SUBCELLS = 4  # range and azimuth tables exist for 4 x 4 positions of the vehicle inside its cell
NEVER = np.float32(0.0)  # stamps are vehicle time, which is positive
# Inner edges of the rings of cells that share one angular erosion.
RING_M = (0.0, 0.3, 0.5, 0.7, 1.0, 1.4, 1.9, 2.6, 3.5, 4.6, 6.0, 8.0, 11.0)
CENTRE_BAND_M = 2.0  # the vehicle may stray this far from the middle before the map rolls

AZIMUTH_RAD = (np.arange(AZIMUTH_BINS) + 0.5) * (math.tau / AZIMUTH_BINS)  # bin centres, 0 north, clockwise
AZIMUTH_DIR = np.stack([np.cos(AZIMUTH_RAD), np.sin(AZIMUTH_RAD)], axis=1)  # (bins, 2) north, east


@dataclass(frozen=True, slots=True)
class MapParams:
    """Size and memory of the rolling map."""

    cell_m: float = param(0.2, "SN_MAP_CELL", "Edge of a cell", "m", 0.05, 0.5)
    cells: int = param(144, "SN_MAP_CELLS", "Cells along one side of the map", "", 40, 400)
    sense_m: float = param(14.0, "SN_MAP_SENSE", "Ranges beyond this are not entered", "m", 3.0, 40.0)
    certified_s: float = param(
        5.0, "SN_MAP_CERT_T", "A hit may not occupy a cell certified free this lately", "s", 0, 60
    )
    forget_s: float = param(90.0, "SN_MAP_FORGET", "A hit not seen again is dropped after this time", "s", 1.0, 3600)
    noise_m: float = param(0.03, "SN_MAP_NOISE", "Range error the certified wedge keeps clear of", "m", 0.0, 0.5)
    blend: float = param(
        1.0, "SN_MAP_BLEND", "Weight of a new hit in a cell that holds one (1: the newest)", "", 0.05, 1
    )


@dataclass(frozen=True, slots=True)
class PolarScan:
    """One scan laid flat: horizontal ranges per azimuth bin of local NED."""

    t_s: float
    pos_ne_m: F64  # (2,)
    free_m: F64  # (AZIMUTH_BINS,) proven free this far; 0 where unknown
    hit_bin: NDArray[np.intp]  # (h,) azimuth bins that lie in a sector with a hit
    hit_m: F64  # (h,) horizontal range of that sector's hit
    hit_sector: NDArray[np.intp]  # (h,) sector of each, to treat an arc as one


@dataclass(frozen=True, slots=True)
class Lately:
    """What the last scans showed; the map only keeps it (``perception.noise``)."""

    sigma_m: float  # of a ray
    scan: PolarScan  # the last, as it came
    pos_ne_m: F64  # (h, 2) of the last few, newest first
    free_m: F64  # (h, AZIMUTH_BINS) how far each of them looked


@dataclass(frozen=True, slots=True)
class GridMap:
    """Square of cells; index [0, 0] is the south-west corner, first axis north, second east."""

    cell_m: float
    corner: tuple[int, int]  # cell coordinates of [0, 0]: floor(position / cell_m)
    free_t: F32  # (n, n) when last certified free
    hit_t: F32  # (n, n) when last hit, NEVER if free since
    hit_ne_m: F32  # (n, n, 2) the hit itself, finer than the cell
    moved_ne_m: F64  # (m, 2) middle of each arc of the last scan that lies, to a cell's depth, in space free lately
    lately: Lately | None = None  # where range noise is reckoned with


def empty(params: MapParams) -> GridMap:
    """A map that has seen nothing, centred on the local origin."""
    n = params.cells
    return GridMap(
        params.cell_m,
        (-(n // 2), -(n // 2)),
        np.full((n, n), NEVER, np.float32),
        np.full((n, n), NEVER, np.float32),
        np.zeros((n, n, 2), np.float32),
        np.empty((0, 2)),
    )


def update(grid: GridMap, scan: PolarScan, params: MapParams) -> GridMap:
    """The map after one more scan."""
    grid = _rolled(grid, scan.pos_ne_m)
    certain = _certain(grid, scan, params)
    free_t = certain * np.float32(scan.t_s)
    np.maximum(free_t, grid.free_t, out=free_t)
    hit_t = np.subtract(1.0, certain, out=certain)
    hit_t *= grid.hit_t
    hit_ne_m = grid.hit_ne_m.copy()
    moved_ne_m = _paint(grid, free_t, hit_t, hit_ne_m, scan, params)
    return GridMap(grid.cell_m, grid.corner, free_t, hit_t, hit_ne_m, moved_ne_m)


def with_hits(grid: GridMap, hits_ne_m: F64, pos_ne_m: F64, t_s: float) -> GridMap:
    """The map round the vehicle with the hits (k, 2) of another map as well, as if seen now: the next scan refutes."""
    grid = _rolled(grid, pos_ne_m)
    cells, inside = cells_of(grid, hits_ne_m)
    hit_t, hit_ne_m = grid.hit_t.copy(), grid.hit_ne_m.copy()
    hit_t.ravel()[cells[inside]] = t_s
    hit_ne_m.reshape(-1, 2)[cells[inside]] = hits_ne_m[inside]
    return GridMap(grid.cell_m, grid.corner, grid.free_t, hit_t, hit_ne_m, np.empty((0, 2)))


def occupied(grid: GridMap, t_s: float, params: MapParams) -> NDArray[np.bool_]:
    """(n, n) cells that hold a hit young enough to count."""
    return grid.hit_t > np.float32(max(t_s - params.forget_s, 0.0))


def occupied_points(grid: GridMap, t_s: float, params: MapParams) -> F64:
    """(k, 2) remembered hits, north and east."""
    cells = occupied(grid, t_s, params).ravel().nonzero()[0]
    return grid.hit_ne_m.reshape(-1, 2).take(cells, axis=0).astype(np.float64)


def cells_of(grid: GridMap, points_ne_m: F64) -> tuple[Index, NDArray[np.bool_]]:
    """Flat cell index of each point (k, 2), 0 outside the map, and whether the point lies inside."""
    n = grid.free_t.shape[0]
    cells = np.floor(points_ne_m.T / grid.cell_m).astype(np.intp, order="C")  # long rows are quicker than long columns
    cells -= np.array(grid.corner, np.intp)[:, None]
    row, column = cells
    inside = (row.view(np.uintp) < n) & (column.view(np.uintp) < n)  # what is negative becomes large
    return (row * n + column) * inside, inside


def centres(grid: GridMap) -> tuple[F64, F64]:
    """North of each row and east of each column, (n,) and (n,)."""
    n = grid.free_t.shape[0]
    steps: F64 = np.arange(n, dtype=np.float64) + 0.5
    return (grid.corner[0] + steps) * grid.cell_m, (grid.corner[1] + steps) * grid.cell_m


def seen(grid: GridMap, points_ne_m: F64) -> NDArray[np.bool_]:
    """(k,) whether each point lies in a cell that was ever certified free or hit."""
    flat, inside = cells_of(grid, points_ne_m)
    return inside & ((grid.free_t.take(flat) > NEVER) | (grid.hit_t.take(flat) > NEVER))


def _rolled(grid: GridMap, pos_ne_m: F64) -> GridMap:
    """Shift whole cells so that the vehicle is near the middle."""
    n = grid.free_t.shape[0]
    here = (math.floor(pos_ne_m[0] / grid.cell_m), math.floor(pos_ne_m[1] / grid.cell_m))
    di, dj = here[0] - grid.corner[0] - n // 2, here[1] - grid.corner[1] - n // 2
    band = CENTRE_BAND_M / grid.cell_m
    if abs(di) <= band and abs(dj) <= band:
        return grid
    return GridMap(
        grid.cell_m,
        (grid.corner[0] + di, grid.corner[1] + dj),
        _shifted(grid.free_t, di, dj, NEVER),
        _shifted(grid.hit_t, di, dj, NEVER),
        _shifted(grid.hit_ne_m, di, dj, np.float32(0.0)),
        grid.moved_ne_m,
    )


def _shifted(cells: F32, di: int, dj: int, fill: np.float32) -> F32:
    out = np.full_like(cells, fill)
    n = cells.shape[0]
    if abs(di) < n and abs(dj) < n:
        to_i, from_i = slice(max(0, -di), n - max(0, di)), slice(max(0, di), n - max(0, -di))
        to_j, from_j = slice(max(0, -dj), n - max(0, dj)), slice(max(0, dj), n - max(0, -dj))
        out[to_i, to_j] = cells[from_i, from_j]
    return out


def _certain(grid: GridMap, scan: PolarScan, params: MapParams) -> F32:
    """(n, n) 1 for every cell that lies inside the proven wedge but for the tips of its corners (a fifth of a cell).

    Numbers, not a mask: arithmetic is five times as fast as masked writes on a mask this ragged.
    """
    table = _polar_table(params.cell_m, round(params.sense_m / params.cell_m))
    eroded = _eroded((np.minimum(scan.free_m, params.sense_m) - params.noise_m).astype(np.float32), table)
    (i, sub_i), (j, sub_j) = (_sub_cell(place_m / grid.cell_m) for place_m in scan.pos_ne_m.tolist())
    reach = eroded.ravel().take(table.ring_bin[sub_i, sub_j], mode="wrap")  # none is outside: quicker than a check
    certain = np.zeros(grid.free_t.shape, np.float32)
    window, part = _window(len(certain), i - grid.corner[0], j - grid.corner[1], table.radius_cells)
    certain[window] = (table.far_edge_m[sub_i, sub_j] < reach)[part]
    return certain


def _sub_cell(place: float) -> tuple[int, int]:
    """Cell that holds a coordinate given in cells, and which part of the cell."""
    cell = math.floor(place)
    return cell, min(int((place - cell) * SUBCELLS), SUBCELLS - 1)


def _eroded(free_m: F32, table: "_PolarTable") -> F32:
    """(rings, bins) least proven range within the half width of each ring, widest first.

    The minimum over h + k bins to either side is that over h bins, taken k bins to the left and to the right.
    """
    rings = np.empty((len(RING_M), AZIMUTH_BINS), np.float32)
    pad = table.half_width_bins[0]
    least = np.concatenate([free_m[-pad:], free_m, free_m[:pad]])
    width = 0
    for ring in range(len(RING_M) - 1, -1, -1):
        while width < table.half_width_bins[ring]:
            more = min(table.half_width_bins[ring] - width, 2 * width + 1)
            least = np.minimum(least[2 * more :], least[: -2 * more])
            width += more
        rings[ring] = least[pad - width : pad - width + AZIMUTH_BINS]
    return rings


def _paint(grid: GridMap, free_t: F32, hit_t: F32, hit_ne_m: F32, scan: PolarScan, params: MapParams) -> F64:
    """Enter the hits: only where the arc was not certified free lately, or all of it if all of it was.

    Returns the middles of the latter arcs, (m, 2), but for those with a cell behind them that was not certified: the
    rim of something that stands and is passed shows itself a few centimetres inside cells that count as free.
    """
    near = (scan.hit_m < params.sense_m).nonzero()[0]
    if len(near) == 0:
        return np.empty((0, 2))
    sector, direction = scan.hit_sector.take(near), AZIMUTH_DIR.take(scan.hit_bin.take(near), axis=0)
    points = direction * scan.hit_m.take(near)[:, None] + scan.pos_ne_m
    flat, inside = cells_of(grid, points)
    lately = np.float32(max(scan.t_s - params.certified_s, 0.0))
    possible = inside & (free_t.take(flat) <= lately)
    whole = (np.bincount(sector, possible) == 0.0).take(sector)
    paint = inside & (possible | whole)
    cells = flat.compress(paint)
    weight = (
        np.where(hit_t.take(cells) > NEVER, np.float32(params.blend), np.float32(1.0)) if params.blend < 1.0 else None
    )
    hit_t.ravel()[cells] = scan.t_s
    _place(hit_ne_m, cells, points.compress(paint, axis=0), weight)
    if not whole.any():
        return np.empty((0, 2))
    behind, there = cells_of(grid, points + direction * grid.cell_m)
    stands = ~(there & (free_t.take(behind) > lately))
    whole &= (np.bincount(sector, stands) == 0.0).take(sector)
    count = np.bincount(sector, whole)
    moved = np.flatnonzero(count)
    middle = [np.bincount(sector, whole * points[:, axis])[moved] / count[moved] for axis in (0, 1)]
    return np.stack(middle, axis=1)


def _place(hit_ne_m: F32, cells: Index, points_ne_m: F64, weight: F32 | None) -> None:
    """Write the hits of one scan; of several in one cell the middle of first and last, so that left equals right.

    ``weight`` of each against what its cell holds already: range noise averages out; None: nothing of that stays.
    """
    stored = hit_ne_m.reshape(-1).view(np.complex64)  # north and east as one number: a third of the time
    before = None if weight is None else stored.take(cells)
    points = points_ne_m.astype(np.float32).reshape(-1).view(np.complex64)
    stored[cells[::-1]] = points[::-1]
    first = stored.take(cells)
    stored[cells] = points
    middle = (first + stored.take(cells)) * np.float32(0.5)
    stored[cells] = middle if before is None or weight is None else before + (middle - before) * weight


def _window(n: int, i: int, j: int, radius: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Where a (2 radius + 1) square round cell (i, j) overlaps the map, in map and in square indices."""
    in_map, in_square = [], []
    for centre in (i, j):
        low, high = max(0, centre - radius), min(n, centre + radius + 1)
        in_map.append(slice(low, max(low, high)))
        in_square.append(slice(low - centre + radius, max(low, high) - centre + radius))
    return (in_map[0], in_map[1]), (in_square[0], in_square[1])


@dataclass(frozen=True, slots=True)
class _PolarTable:
    """Where every cell of a square lies as seen from each sub-cell position of its middle cell."""

    radius_cells: int
    ring_bin: NDArray[np.intp]  # (SUBCELLS, SUBCELLS, m, m) ring * AZIMUTH_BINS + azimuth bin of the cell's centre
    far_edge_m: F32  # (SUBCELLS, SUBCELLS, m, m) farthest the cell can reach
    half_width_bins: tuple[int, ...]  # per ring: half the angle under which a cell appears


@lru_cache(maxsize=4)
def _polar_table(cell_m: float, radius_cells: int) -> _PolarTable:
    extent = cell_m / 2 * (1.0 + 1.0 / SUBCELLS)  # of a cell as a disc, seen from anywhere in the vehicle's sub-cell
    steps = np.arange(-radius_cells, radius_cells + 1) + 0.5
    sub = (np.arange(SUBCELLS) + 0.5) / SUBCELLS
    north = (steps[None, :] - sub[:, None])[:, None, :, None] * cell_m
    east = (steps[None, :] - sub[:, None])[None, :, None, :] * cell_m
    centre_m = np.hypot(north, east)
    ring = np.searchsorted(RING_M, centre_m, side="right") - 1
    azimuth_bin = np.floor(np.arctan2(east, north) % math.tau / math.tau * AZIMUTH_BINS).astype(np.int32)
    widths = [math.pi if r <= extent else math.asin(extent / r) for r in RING_M]
    half_width = tuple(min(AZIMUTH_BINS // 2 - 1, math.ceil(w / math.tau * AZIMUTH_BINS)) for w in widths)
    ring_bin = (ring * AZIMUTH_BINS + azimuth_bin % AZIMUTH_BINS).astype(np.intp)
    return _PolarTable(radius_cells, ring_bin, (centre_m + extent).astype(np.float32), half_width)
