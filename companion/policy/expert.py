"""Which way does geometry lead? The expert: shortest path on the remembered map, cut to five waypoints; pure.

Teacher, fallback and the bar to beat. It remembers its last path and keeps it until a new one is clearly cheaper, so
that two ways round an obstacle do not take turns. Unknown cells and far hits cost extra but do not block: a sector
minimum seen from far away closes gaps that are open.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from companion.core.geometry import length, resample
from companion.core.gridmap import NEVER, GridMap, MapParams, cells_of, centres, occupied
from companion.core.params import param
from companion.core.types import F64
from companion.policy.blocks import block_of, cells_back, cells_of_blocks, in_blocks, reach_over
from companion.policy.centring import centred, distances, opened
from companion.policy.chords import chords
from companion.policy.grid_path import BLOCKED, LIMIT, Reach, clearances, nearest_cells, reach_from, walk_back
from companion.policy.interface import WAYPOINTS, Proposal, Query


@dataclass(frozen=True, slots=True)
class ExpertParams:
    """What the geometric expert prefers."""

    margin_m: float = param(0.22, "SN_EX_MARGIN", "Clearance beyond the radius that a path should keep", "m", 0.0, 1.0)
    tight_m: float = param(0.10, "SN_EX_TIGHT", "The same where there is no other way", "m", 0.0, 1.0)
    comfort_m: float = param(1.3, "SN_EX_COMFORT", "Clearance beyond which a path costs only its length", "m", 0.1, 5.0)
    comfort_cost: float = param(4.0, "SN_EX_COMF_W", "Extra cost at the least clearance", "", 0.0, 50.0)
    unknown_cost: float = param(0.6, "SN_EX_UNKNOWN", "Extra cost of a cell never seen", "", 0.0, 50.0)
    wall_m: float = param(
        0.0, "SN_EX_WALL", "A cell never seen this near to a hit counts as more of it (0: not so)", "m", 0, 5
    )
    wall_cost: float = param(2.0, "SN_EX_WALL_COST", "Extra cost of such a cell", "", 0.0, 50.0)
    wall_line_cost: float = param(0.5, "SN_EX_WALL_LINE", "The same for a metre off the line", "1/m", 0.0, 10.0)
    hard_range_m: float = param(6.0, "SN_EX_HARD", "Hits beyond this cost, but do not block", "m", 0.5, 40.0)
    far_cost: float = param(12.0, "SN_EX_FAR", "Extra cost of a far blocked cell", "", 0.0, 200.0)
    beyond_cost: float = param(1.0, "SN_EX_BEYOND", "Cost a metre of the way beyond the map to the goal", "", 1.0, 10.0)
    keep_ratio: float = param(1.12, "SN_EX_KEEP", "The old path stays until a new one is this much cheaper", "", 1, 3)
    length_m: float = param(8.0, "SN_EX_LENGTH", "Length of the five waypoints at most", "m", 1.0, 20.0)
    chord_m: float = param(0.06, "SN_EX_CHORD", "How far a chord may leave the path", "m", 0.01, 0.5)
    useful_m: float = param(3.0, "SN_EX_USEFUL", "Chords are relaxed where waypoints reach less far", "m", 0.2, 10.0)
    sweeps: int = param(25, "SN_EX_SWEEPS", "Elastic-band sweeps that smooth the path", "", 0, 200)
    push_m: float = param(0.0, "SN_EX_PUSH", "How far each sweep pushes off what is too near (0: not)", "m", 0.0, 0.05)
    push_to_m: float = param(0.15, "SN_EX_PUSH_TO", "Clearance beyond the radius up to which it does", "m", 0.0, 1.0)


BORDER_CELLS = 2  # paths to a goal outside the map end in this rim
CHORD_RELAX = (1.0, 2.0, 4.0)
FINE_M = 0.1  # cells up to this edge are searched in blocks of two
UNREACHED = 4.0  # cost a cell from where a way ends to a goal on the map: that is approached as near as possible


@dataclass(frozen=True, slots=True)
class _Hits:
    """What the clearance was measured from."""

    grid: GridMap
    nearest_cell: NDArray[np.int32] | None  # (n, n) of the nearest hit; None: there is none
    places_ne_m: F64  # (k, 2)


@dataclass(frozen=True, slots=True)
class _Field:
    """The map as the planner sees it."""

    cost: F64  # (n, n)
    clearance_m: F64  # (n, n)
    hard_m: float
    hits: _Hits


class GeometricExpert:
    """Policy 'geometric'. Memory: the full path last planned, (k, 2) north and east."""

    name = "geometric"

    def __init__(self, params: ExpertParams, map_params: MapParams) -> None:
        self._params = params
        self._map = map_params

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """Five waypoints along the cheapest path; see ``Policy.propose``."""
        grid, hits = _with_hazards(query, occupied(query.grid, query.state.t_s, self._map))
        known = _Hits(grid, nearest_cells(hits) if hits.any() else None, grid.hit_ne_m[hits].astype(np.float64))
        clearance = np.full(hits.shape, np.inf) if known.nearest_cell is None else clearances(grid, known.nearest_cell)
        for margin in (self._params.margin_m, self._params.tight_m):
            field = _field(query, clearance, known, query.radius_m + margin, self._params)
            path = _plan(query, field, memory, self._params)
            if path is not None:
                return Proposal(_cut(_joined(query.prefix_ne_m, path), self._params)), path
        return None, None


def _with_hazards(query: Query, hits: NDArray[np.bool_]) -> tuple[GridMap, NDArray[np.bool_]]:
    """The map as if what moves stood wherever it is about to be."""
    cells, inside = cells_of(query.grid, query.hazard_ne_m)
    if not inside.any():
        return query.grid, hits
    hit_ne_m = query.grid.hit_ne_m.copy()
    hit_ne_m.reshape(-1, 2)[cells[inside]] = query.hazard_ne_m[inside]
    hits.ravel()[cells[inside]] = True
    return replace(query.grid, hit_ne_m=hit_ne_m), hits


def _field(query: Query, clearance_m: F64, hits: _Hits, hard_m: float, params: ExpertParams) -> _Field:
    """Cost per cell: length, nearness to hits, the unknown, and walls near by."""
    comfort_m = query.radius_m + params.comfort_m
    cost = comfort_m - clearance_m
    cost /= comfort_m - query.radius_m
    np.minimum(np.maximum(cost, 0.0, out=cost), 1.0, out=cost)  # how much is lacking
    cost *= params.comfort_cost * cost
    cost += 1.0
    grid = query.grid
    unknown = (grid.free_t <= NEVER) & (grid.hit_t <= NEVER)
    cost += params.unknown_cost * unknown
    if params.wall_m > 0.0:
        cost += _on_behind_the_wall(query, params) * (unknown & (clearance_m < params.wall_m))
    north, east = centres(grid)
    dn, de = north - query.state.pos_ned_m[0], east - query.state.pos_ned_m[1]
    square = (dn * dn)[:, None] + (de * de)[None, :]
    if params.push_m > 0.0 and hits.nearest_cell is not None:
        clearance_m = opened(hits.grid, clearance_m, hits.nearest_cell, hard_m)
    tight = clearance_m < hard_m
    near = square < params.hard_range_m**2
    cost += params.far_cost * (tight & ~near)
    blocked = tight & near
    here_m = _at(grid, clearance_m, query.state.pos_ned_m[:2])
    if here_m < hard_m:  # already too near: may leave through cells no nearer than here
        blocked &= (clearance_m < here_m - grid.cell_m / 2) | (square > 1.0)
        cost += params.far_cost * (tight & near)
    cost[blocked] = BLOCKED
    return _Field(cost, clearance_m, hard_m, hits)


def _on_behind_the_wall(query: Query, params: ExpertParams) -> F64:
    """(n, n) extra cost of passing a wall beyond its seen end: at grazing angle an opening there would not show.

    So an opening that was seen is taken first, and both ways along the wall are looked at, the nearer to the line from
    start to goal first: what lies far off it on this side comes after what lies near on the other.
    """
    north, east = centres(query.grid)
    way = query.goal_ne_m - query.start_ne_m
    way = way / max(float(np.hypot(*way)), query.grid.cell_m)
    right = way[0] * (east - query.start_ne_m[1])[None, :] - way[1] * (north - query.start_ne_m[0])[:, None]
    cost: F64 = params.wall_cost + params.wall_line_cost * np.abs(right)
    return cost


def _plan(query: Query, field: _Field, old: F64 | None, params: ExpertParams) -> F64 | None:
    """The path to fly on, (k, 2) from the anchor; the old one unless a new one is clearly cheaper."""
    grid = query.grid
    source = _cell(grid, query.prefix_ne_m[-1])
    if field.cost.ravel()[source] >= BLOCKED:
        source = _nearest_open(grid, field, query.prefix_ne_m[-1])
    ahead = _straight_cells(query)
    kept = _kept(query, field, old, params)
    beyond = 1.0 if _on_map(grid, query.goal_ne_m) else params.beyond_cost
    detour = LIMIT
    if kept is not None:
        worth = _path_cost(kept, query, field, params, beyond) / (params.keep_ratio * grid.cell_m)
        detour = worth - float(ahead.ravel()[source]) - (beyond - 1.0) * float(ahead.min())
    cells = _cheapest(field.cost, source, ahead, detour, beyond, _block(grid)) if detour > 0.0 else None
    if cells is None and kept is None and _block(grid) > 1:
        cells = _cheapest(field.cost, source, ahead, detour, beyond, 1)
    return kept if cells is None else _smooth(_places(cells, query), query, field, params)


def _straight_cells(query: Query) -> F64:
    """(n, n) straight distance from each cell to the goal, in cells."""
    north, east = centres(query.grid)
    dn, de = north - query.goal_ne_m[0], east - query.goal_ne_m[1]
    straight: F64 = np.sqrt((dn * dn)[:, None] + (de * de)[None, :])
    straight /= query.grid.cell_m
    return straight


def _cheapest(cost: F64, source: int, ahead: F64, detour: float, beyond: float, block: int) -> list[int] | None:
    """Cells of the cheapest way off the map towards the goal, or onto it; None if it takes more than ``detour``.

    ``detour`` is counted beyond the straight way, ``beyond`` is the cost of a metre from the map's rim to the goal.
    ``block``: the way is looked for over blocks of so many cells a side.
    """
    goal = int(ahead.argmin())
    least = float(ahead.ravel()[goal])
    if block == 1:
        reach = reach_from(cost, source, ahead, detour)
        best = _best_end(reach, source, ahead, least, detour, beyond)
        return None if best is None else walk_back(reach, best)
    on_map = least < 1.0 and cost.ravel()[goal] < BLOCKED
    blocks = in_blocks(cost, block, (source, goal) if on_map else (source,))
    ahead, source = ahead.take(cells_of_blocks(blocks)), block_of(blocks, source)
    reach = reach_over(blocks, source, ahead, detour)
    best = _best_end(reach, source, ahead, least, detour, beyond)
    return None if best is None else cells_back(blocks, reach, best)


def _best_end(reach: Reach, source: int, ahead: F64, least: float, detour: float, beyond: float) -> int | None:
    """Where the cheapest way ends; ``least`` of ``ahead`` tells whether the goal is on the map."""
    inside = least < 1.0
    cells = np.arange(ahead.size) if inside else _rim(len(ahead))
    total = reach.cost[cells] + (UNREACHED if inside else beyond) * ahead.ravel()[cells]
    best = int(np.argmin(total))
    if not total[best] < min(detour, LIMIT) + ahead.ravel()[source] + (beyond - 1.0) * least:
        return None
    return int(cells[best])


def _block(grid: GridMap) -> int:
    """Cells along the side of a block."""
    return 2 if grid.cell_m < FINE_M + 1e-6 and len(grid.free_t) % 2 == 0 else 1


@lru_cache(maxsize=4)
def _rim(n: int) -> NDArray[np.intp]:
    rim = np.ones((n, n), bool)
    rim[BORDER_CELLS:-BORDER_CELLS, BORDER_CELLS:-BORDER_CELLS] = False
    return np.flatnonzero(rim)


def _places(cells: list[int], query: Query) -> F64:
    """(k, 2) centres of the cells, from the anchor on."""
    north, east = centres(query.grid)
    row, column = np.divmod(cells, len(north))
    path = np.stack([north[row], east[column]], axis=1)
    path[0] = query.prefix_ne_m[-1]
    if _arrives(path, query):
        path[-1] = query.goal_ne_m
    return path


def _arrives(path: F64, query: Query) -> bool:
    """Does the path lead to the goal, but for the last cell?"""
    return math.dist(path[-1].tolist(), query.goal_ne_m.tolist()) < 1.5 * query.grid.cell_m


def _on_map(grid: GridMap, point_ne_m: F64) -> bool:
    return bool(cells_of(grid, point_ne_m[None, :])[1][0])


def _kept(query: Query, field: _Field, old: F64 | None, params: ExpertParams) -> F64 | None:
    """What is left of the old path from the anchor on, if it is still open."""
    if old is None or len(old) < 2:
        return None
    offset = old - query.prefix_ne_m[-1]
    nearest = int(np.argmin(np.einsum("ij,ij->i", offset, offset)))
    if np.hypot(*offset[nearest]) > 2 * query.grid.cell_m or nearest >= len(old) - 2:
        return None
    rest = np.concatenate([query.prefix_ne_m[-1][None], old[nearest + 1 :]])
    if not _arrives(rest, query) and (length(rest) < params.length_m or _on_map(query.grid, query.goal_ne_m)):
        return None  # it ended where the map once did, or where the goal could not be reached: look on
    costs = _fine_cost(rest, query, field, params) if params.push_m > 0.0 else _sample(query.grid, field.cost, rest)
    return None if (costs >= BLOCKED).any() else rest


def _path_cost(path: F64, query: Query, field: _Field, params: ExpertParams, beyond: float) -> float:
    """Cost of a path plus the straight rest to the goal, in metres."""
    step = np.hypot(*(np.diff(path, axis=0).T))
    middle = (path[1:] + path[:-1]) / 2
    fine = params.push_m > 0.0
    cost = _fine_cost(middle, query, field, params) if fine else _sample(query.grid, field.cost, middle)
    rest = float(np.hypot(*(path[-1] - query.goal_ne_m)))
    return float(step @ np.minimum(cost, BLOCKED)) + beyond * rest


def _fine_cost(places: F64, query: Query, field: _Field, params: ExpertParams) -> F64:
    """Cost at places by their own distance to the hits, not by that of their cells; BLOCKED inside the hull."""
    cost = np.minimum(_sample(query.grid, field.cost, places), 1.0 + params.comfort_cost + params.unknown_cost)
    near = np.hypot(*(places - query.state.pos_ned_m[:2]).T) < params.hard_range_m
    cost[near & (distances(places, field.hits.places_ne_m, query.radius_m) < query.radius_m)] = BLOCKED
    return cost


def _smooth(path: F64, query: Query, field: _Field, params: ExpertParams) -> F64:
    """Elastic band: pull every point to the middle of its neighbours while its clearance allows it; or push it there.

    Cells are too coarse where a gap leaves a few centimetres: there the hits themselves push, to the middle of the gap.
    """
    if len(path) <= 2:
        return path.copy()
    if params.push_m > 0.0 and field.hits.nearest_cell is not None:
        want_m = query.radius_m + params.push_to_m
        return centred(path, field.hits.places_ne_m, want_m, params.push_m, params.sweeps)
    grid = query.grid
    floor = np.minimum(_sample(grid, field.clearance_m, path), field.hard_m + 2 * grid.cell_m) - grid.cell_m / 4
    for _ in range(params.sweeps):
        moved = path.copy()
        moved[1:-1] = 0.5 * path[1:-1] + 0.25 * (path[2:] + path[:-2])
        fine = _sample(grid, field.clearance_m, moved) >= floor
        fine[0] = fine[-1] = True
        path = np.where(fine[:, None], moved, path)
    return path


def _joined(prefix: F64, path: F64) -> F64:
    """Committed stretch and new path as one, in steps short enough for chords to follow."""
    return np.concatenate([resample(prefix, 0.2)[:-1], path]) if len(prefix) > 1 else path


def _cut(path: F64, params: ExpertParams) -> F64:
    """At most five waypoints (k, 2) whose chords stay near the path."""
    for relax in CHORD_RELAX:
        waypoints = chords(path, params.chord_m * relax, params.length_m)
        if length(np.concatenate([path[:1], waypoints])) >= params.useful_m or len(waypoints) < WAYPOINTS:
            break
    return waypoints


def _cell(grid: GridMap, point_ne_m: F64) -> int:
    n = grid.free_t.shape[0]
    i = math.floor(point_ne_m[0] / grid.cell_m) - grid.corner[0]
    j = math.floor(point_ne_m[1] / grid.cell_m) - grid.corner[1]
    return int(min(max(i, 0), n - 1) * n + min(max(j, 0), n - 1))


def _at(grid: GridMap, values: F64, point_ne_m: F64) -> float:
    return float(values.ravel()[_cell(grid, point_ne_m)])


def _sample(grid: GridMap, values: F64, points_ne_m: F64) -> F64:
    n = values.shape[0]
    cells = np.floor(points_ne_m / grid.cell_m).astype(np.intp) - np.array(grid.corner)
    np.clip(cells, 0, n - 1, out=cells)
    sampled: F64 = values[cells[:, 0], cells[:, 1]]
    return sampled


def _nearest_open(grid: GridMap, field: _Field, point_ne_m: F64) -> int:
    """The open cell nearest to a point that lies in a blocked one."""
    north, east = centres(grid)
    square = ((north - point_ne_m[0]) ** 2)[:, None] + ((east - point_ne_m[1]) ** 2)[None, :]
    square = np.where(field.cost >= BLOCKED, np.inf, square)
    return int(np.argmin(square))
