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
from scipy.spatial import cKDTree

from companion.core.geometry import length, resample
from companion.core.gridmap import NEVER, GridMap, MapParams, cells_of, centres, occupied
from companion.core.params import param
from companion.core.types import F64
from companion.policy.grid_path import BLOCKED, LIMIT, clearance_field, reach_from, walk_back
from companion.policy.interface import WAYPOINTS, Proposal, Query


@dataclass(frozen=True, slots=True)
class ExpertParams:
    """What the geometric expert prefers."""

    margin_m: float = param(0.22, "SN_EX_MARGIN", "Clearance beyond the radius that a path should keep", "m", 0.0, 1.0)
    tight_m: float = param(0.10, "SN_EX_TIGHT", "The same where there is no other way", "m", 0.0, 1.0)
    comfort_m: float = param(1.3, "SN_EX_COMFORT", "Clearance beyond which a path costs only its length", "m", 0.1, 5.0)
    comfort_cost: float = param(4.0, "SN_EX_COMF_W", "Extra cost at the least clearance", "", 0.0, 50.0)
    unknown_cost: float = param(0.6, "SN_EX_UNKNOWN", "Extra cost of a cell never seen", "", 0.0, 50.0)
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
QUARTERS = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
CHORD_POINTS = 20  # of the path that one chord replaces, at most
UNREACHED = 4.0  # cost a cell from where a way ends to a goal on the map: that is approached as near as possible


@dataclass(frozen=True, slots=True)
class _Field:
    """The map as the planner sees it."""

    cost: F64  # (n, n)
    clearance_m: F64  # (n, n)
    hard_m: float
    hits_ne_m: F64  # (k, 2) what the clearance was measured from


class GeometricExpert:
    """Policy 'geometric'. Memory: the full path last planned, (k, 2) north and east."""

    name = "geometric"

    def __init__(self, params: ExpertParams, map_params: MapParams) -> None:
        self._params = params
        self._map = map_params

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """Five waypoints along the cheapest path; see ``Policy.propose``."""
        grid, hits = _with_hazards(query, occupied(query.grid, query.state.t_s, self._map))
        clearance, hits_ne_m = clearance_field(grid, hits), grid.hit_ne_m[hits].astype(np.float64)
        for margin in (self._params.margin_m, self._params.tight_m):
            field = _field(query, clearance, hits_ne_m, query.radius_m + margin, self._params)
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


def _field(query: Query, clearance_m: F64, hits_ne_m: F64, hard_m: float, params: ExpertParams) -> _Field:
    """Cost per cell: length, nearness to hits, the unknown, and walls near by."""
    comfort_m = query.radius_m + params.comfort_m
    lack = np.clip((comfort_m - clearance_m) / (comfort_m - query.radius_m), 0.0, 1.0)
    cost = 1.0 + params.comfort_cost * lack * lack
    grid = query.grid
    cost += params.unknown_cost * ((grid.free_t <= NEVER) & (grid.hit_t <= NEVER))
    north, east = centres(grid)
    dn, de = north - query.state.pos_ned_m[0], east - query.state.pos_ned_m[1]
    square = (dn * dn)[:, None] + (de * de)[None, :]
    if params.push_m > 0.0:
        clearance_m = _opened(grid, clearance_m, hits_ne_m, hard_m)
    tight = clearance_m < hard_m
    near = square < params.hard_range_m**2
    cost += params.far_cost * (tight & ~near)
    blocked = tight & near
    here_m = _at(grid, clearance_m, query.state.pos_ned_m[:2])
    if here_m < hard_m:  # already too near: may leave through cells no nearer than here
        blocked &= (clearance_m < here_m - grid.cell_m / 2) | (square > 1.0)
        cost += params.far_cost * (tight & near)
    cost[blocked] = BLOCKED
    return _Field(cost, clearance_m, hard_m, hits_ne_m)


def _opened(grid: GridMap, clearance_m: F64, hits_ne_m: F64, hard_m: float) -> F64:
    """Clearances, of cells that just miss ``hard_m`` the best of four places inside: gaps narrow as cells stay open."""
    row, column = np.nonzero((clearance_m < hard_m) & (clearance_m > hard_m - 0.5 * grid.cell_m))
    if len(row) == 0:
        return clearance_m
    north, east = centres(grid)
    middle = np.stack([north[row], east[column]], axis=1)
    places = middle[:, None, :] + grid.cell_m / 4 * QUARTERS
    distance, _ = cKDTree(hits_ne_m).query(places.reshape(-1, 2))
    opened = clearance_m.copy()
    opened[row, column] = np.maximum(clearance_m[row, column], distance.reshape(-1, len(QUARTERS)).max(axis=1))
    return opened


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
    cells = _cheapest(field.cost, source, ahead, detour, beyond) if detour > 0.0 else None
    return kept if cells is None else _smooth(_places(cells, query), query, field, params)


def _straight_cells(query: Query) -> F64:
    """(n, n) straight distance from each cell to the goal, in cells."""
    north, east = centres(query.grid)
    dn, de = north - query.goal_ne_m[0], east - query.goal_ne_m[1]
    straight: F64 = np.sqrt((dn * dn)[:, None] + (de * de)[None, :])
    straight /= query.grid.cell_m
    return straight


def _cheapest(cost: F64, source: int, ahead: F64, detour: float, beyond: float) -> list[int] | None:
    """Cells of the cheapest way off the map towards the goal, or onto it; None if it takes more than ``detour``.

    ``detour`` is counted beyond the straight way, ``beyond`` is the cost of a metre from the map's rim to the goal.
    """
    reach = reach_from(cost, source, ahead, detour)
    least = float(ahead.min())
    inside = least < 1.0
    cells = np.arange(cost.size) if inside else _rim(cost.shape[0])
    total = reach.cost[cells] + (UNREACHED if inside else beyond) * ahead.ravel()[cells]
    best = int(np.argmin(total))
    if not total[best] < min(detour, LIMIT) + ahead.ravel()[source] + (beyond - 1.0) * least:
        return None
    return walk_back(reach, int(cells[best]))


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
    if len(field.hits_ne_m):
        near = np.hypot(*(places - query.state.pos_ned_m[:2]).T) < params.hard_range_m
        clearance, _ = cKDTree(field.hits_ne_m).query(places, distance_upper_bound=query.radius_m)
        cost[near & (clearance < query.radius_m)] = BLOCKED
    return cost


def _smooth(path: F64, query: Query, field: _Field, params: ExpertParams) -> F64:
    """Elastic band: pull every point to the middle of its neighbours while its clearance allows it; or push it there.

    Cells are too coarse where a gap leaves a few centimetres: there the hits themselves push, to the middle of the gap.
    """
    if len(path) <= 2:
        return path.copy()
    if params.push_m > 0.0 and len(field.hits_ne_m):
        return _centred(path, field.hits_ne_m, query.radius_m + params.push_to_m, params)
    grid = query.grid
    floor = np.minimum(_sample(grid, field.clearance_m, path), field.hard_m + 2 * grid.cell_m) - grid.cell_m / 4
    for _ in range(params.sweeps):
        moved = path.copy()
        moved[1:-1] = 0.5 * path[1:-1] + 0.25 * (path[2:] + path[:-2])
        fine = _sample(grid, field.clearance_m, moved) >= floor
        fine[0] = fine[-1] = True
        path = np.where(fine[:, None], moved, path)
    return path


def _centred(path: F64, hits_ne_m: F64, want_m: float, params: ExpertParams) -> F64:
    """Every sweep: to the middle of the neighbours, then off the nearest hit, by ``push_m`` at most."""
    path = path.copy()
    tree = cKDTree(hits_ne_m)
    for _ in range(params.sweeps):
        path[1:-1] = 0.5 * path[1:-1] + 0.25 * (path[2:] + path[:-2])
        distance, nearest = tree.query(path[1:-1], distance_upper_bound=want_m)
        near = np.flatnonzero(distance < want_m)
        step = np.minimum(want_m - distance[near], params.push_m) / np.maximum(distance[near], 1e-6)
        path[1 + near] += (path[1 + near] - hits_ne_m[nearest[near]]) * step[:, None]
    return path


def _joined(prefix: F64, path: F64) -> F64:
    """Committed stretch and new path as one, in steps short enough for chords to follow."""
    return np.concatenate([resample(prefix, 0.2)[:-1], path]) if len(prefix) > 1 else path


def _cut(path: F64, params: ExpertParams) -> F64:
    """At most five waypoints (k, 2) whose chords stay near the path."""
    for relax in CHORD_RELAX:
        waypoints = _chords(path, params.chord_m * relax, params.length_m)
        if length(np.concatenate([path[:1], waypoints])) >= params.useful_m or len(waypoints) < WAYPOINTS:
            break
    return waypoints


def _chords(path: F64, tolerance_m: float, length_m: float) -> F64:
    """Greedy: each chord as long as the path between its ends stays within the tolerance."""
    places = path.tolist()
    picked: list[int] = []
    at, used = 0, 0.0
    while at < len(path) - 1 and len(picked) < WAYPOINTS and used < length_m:
        end = at + 1
        while end + 1 < len(path) and end - at < CHORD_POINTS and _leave_m(places[at : end + 2]) <= tolerance_m:
            end += 1
        used += math.dist(places[at], places[end])
        picked.append(end)
        at = end
    return path[picked]


def _leave_m(places: list[list[float]]) -> float:
    """How far a stretch of path leaves the chord between its ends."""
    (north, east), *between, (end_north, end_east) = places
    dn, de = end_north - north, end_east - east
    chord_m = math.hypot(dn, de)
    if chord_m < 1e-9:
        return math.inf
    return max(abs((n - north) * de - (e - east) * dn) for n, e in between) / chord_m


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
