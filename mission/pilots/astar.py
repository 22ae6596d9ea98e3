"""Follow the cheapest way over a rolling grid, planned anew again and again: what every navigation stack does; pure.

P. Hart, N. Nilsson, B. Raphael 1968 on a costmap whose cost decays with the distance to obstacles (the inflation layer
of ROS Navigation: D. Lu, D. Hershberger, W. Smart, "Layered costmaps", IROS 2014), the path straightened where the line
is as cheap, then followed. Costmap: the navigator's rolling map, never seen counts as free. Line follower, speed limits
along the path and stop rule are the navigator's, as the vehicle is; arbiter, checker and expert are not.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from companion.core import geometry
from companion.core.gridmap import GridMap, centres, occupied
from companion.core.params import param
from companion.core.types import F64
from companion.guidance import follower
from companion.navigator.track import Route, course_along, track
from companion.policy.grid_path import BLOCKED, LIMIT, clearance_field, reach_from, walk_back
from mission.pilots.cockpit import Recipe, View, Wish, stop_needed

UNREACHED = 4.0  # cost per cell between where a way ends and a goal on the map
SAMPLES_PER_CELL = 2.0
DEARER = 1.02  # a straight stretch may cost this much more than the steps that it replaces
LOOK = 40  # steps that one straight stretch replaces at most
LEAVE_M = 1.0  # round a vehicle that is too near to something
RIM_CELLS = 2  # paths to a goal outside the map end in this rim


@dataclass(frozen=True, slots=True)
class AstarParams:
    """The costmap and how often it is planned on, tuned."""

    margin_m: float = param(0.2, "AST_MARGIN", "Cells nearer than radius and this are dear", "m", 0.0, 2.0)
    squeeze: float = param(4.0, "AST_SQUEEZE", "Extra cost of those", "", 0.0, 100.0)
    tight_m: float = param(0.02, "AST_TIGHT", "Cells nearer than radius and this block", "m", 0.0, 2.0)
    hard_range_m: float = param(3.0, "AST_HARD", "Cells farther away than this cost, but do not block", "m", 0.5, 40.0)
    far_cost: float = param(12.0, "AST_FAR", "Extra cost of such cells", "", 0.0, 200.0)
    inflation: float = param(4.0, "AST_INFL", "Extra cost at the edge of what blocks", "", 0.0, 100.0)
    decay_1_m: float = param(2.0, "AST_DECAY", "How fast that cost decays with distance", "1/m", 0.1, 20.0)
    period_s: float = param(0.4, "AST_PERIOD", "Time between two plans", "s", 0.05, 5.0)
    lead_s: float = param(0.4, "AST_LEAD", "A new path leaves the old one this far ahead", "s", 0.0, 2.0)


@dataclass(frozen=True, slots=True)
class Plan:
    """The path in force."""

    path_ne_m: F64  # (k, 2)
    s_m: float
    t_s: float
    margin_m: float  # beyond the radius, at which it was planned


@dataclass(frozen=True, slots=True)
class Costmap:
    """What a path costs, cell by cell."""

    grid: GridMap
    cost: F64  # (n, n) at least 1, BLOCKED where nothing may pass


class Astar(Recipe):
    """Pilot 'astar'."""

    name = "astar"
    source = "A* (Hart, Nilsson, Raphael 1968) on an inflated rolling costmap (ROS Navigation), line following"

    def __init__(self, params: AstarParams | None = None) -> None:
        self._params = params or AstarParams()

    def steer(self, view: View, plan: Plan | None) -> tuple[Plan | None, Wish]:
        """See ``Recipe.steer``."""
        due = plan is None or view.state.t_s - plan.t_s >= self._params.period_s - 1e-6
        if due:
            plan = replan(view, plan, self._params)
        if plan is None or stop_needed(view):
            return None, Wish("blocked" if plan is None else "stop", decided=due)
        plan, wish = follow(view, plan)
        return plan, replace(wish, decided=due)


def follow(view: View, plan: Plan) -> tuple[Plan, Wish]:
    """One tick along a path, with the navigator's limits and follower."""
    margin_m = min(view.params.vehicle.corridor_m, plan.margin_m)
    route = Route(plan.path_ne_m, plan.s_m, view.task.cruise_m_s, view.down_m, margin_m)
    tracked = track(route, view.state, view.percept, view.yaw_sp_rad, view.params)
    course = course_along(plan.path_ne_m, plan.s_m)
    plan = replace(plan, s_m=tracked.s_m)
    return plan, Wish("follow", setpoint=tracked.setpoint, course_rad=course, path_ne_m=plan.path_ne_m)


def replan(view: View, old: Plan | None, params: AstarParams) -> Plan | None:
    """A path from a little ahead on the old one (else every plan forgives the tracking error), or from here.

    The last resort knows that a cell's centre may lie half a cell beside the middle of a gap.
    """
    grid = view.percept.grid
    clearance_m = clearance_field(grid, occupied(grid, view.state.t_s, view.params.map))
    _swept(clearance_m, grid, view)
    prefix = committed(view, old, params.lead_s)
    for hard_m in (params.tight_m, params.tight_m - grid.cell_m / 2):
        costmap = costmap_of(view, clearance_m, view.params.vehicle.radius_m + hard_m, params)
        for begin in (prefix, prefix[:1]) if len(prefix) > 1 else (prefix,):
            path = cheapest_path(view, begin[-1], costmap)
            if path is not None:
                path = np.concatenate([begin[:-1], path])
                return Plan(path, 0.0, view.state.t_s, _room(path, view, params))
    return None


def _room(path: F64, view: View, params: AstarParams) -> float:
    """Clearance of the next stretch of a path beyond the radius, from 0 to ``margin_m``."""
    stretch = geometry.part(path, 0.0, params.hard_range_m)
    reach_m = view.params.vehicle.radius_m + params.margin_m
    nearest_m = geometry.nearest_distance(stretch, view.percept.points_ne_m, reach_m)
    return min(max(nearest_m - view.params.vehicle.radius_m, 0.0), params.margin_m)


def committed(view: View, old: Plan | None, lead_s: float) -> F64:
    """(k, 2) the stretch of the old path that is flown next, or just the vehicle's place."""
    here = view.pos_ne_m[None].copy()
    if old is None:
        return here
    at = follower.progress(old.path_ne_m, view.pos_ne_m, old.s_m, view.params.follower)
    if not at.distance_m < view.params.policy.rejoin_m:
        return here
    return geometry.part(old.path_ne_m, at.s_m, at.s_m + float(np.hypot(*view.vel_ne_m_s)) * lead_s)


def cheapest_path(view: View, from_ne_m: F64, costmap: Costmap) -> F64 | None:
    """(k, 2) from a place to the goal, or as far towards it as the map reaches; None: shut in."""
    grid, goal = costmap.grid, view.task.goal_ned_m
    north, east = centres(grid)
    ahead: F64 = np.hypot((north - goal[0])[:, None], (east - goal[1])[None, :]) / grid.cell_m
    source = _cell(grid, from_ne_m)
    reach = reach_from(costmap.cost, source, ahead, LIMIT)
    inside = ahead.min() < 1.0
    cells = np.arange(ahead.size) if inside else _rim(len(north))
    total = reach.cost[cells] + (UNREACHED if inside else 1.0) * ahead.ravel()[cells]
    best = int(np.argmin(total))
    if not total[best] < LIMIT or int(cells[best]) == source:
        return None
    row, column = np.divmod(walk_back(reach, int(cells[best])), len(north))
    path = np.stack([north[row], east[column]], axis=1)
    path[0] = from_ne_m
    if math.dist(path[-1].tolist(), goal.tolist()) < 1.5 * grid.cell_m:
        path[-1] = goal
    return straightened(path, costmap)


def costmap_of(view: View, clearance_m: F64, hard_m: float, params: AstarParams) -> Costmap:
    """Cost of every cell: 1, more near obstacles, BLOCKED where the disc does not fit.

    Far away a sector's minimum closes gaps that are open: there, what blocks is only dear.

    A vehicle that is already nearer than it should be may leave through cells no nearer than its own, up to LEAVE_M.
    """
    grid = view.percept.grid
    dear_m = view.params.vehicle.radius_m + params.margin_m
    cost: F64 = 1.0 + params.inflation * np.exp(-params.decay_1_m * np.maximum(clearance_m - dear_m, 0.0))
    cost += params.squeeze * (clearance_m < dear_m)
    blocked = clearance_m < hard_m
    here_m = float(clearance_m.ravel()[_cell(grid, view.pos_ne_m)])
    north, east = centres(grid)
    away_m = np.hypot((north - view.pos_ne_m[0])[:, None], (east - view.pos_ne_m[1])[None, :])
    far = blocked & (away_m > params.hard_range_m)
    cost += params.far_cost * far
    blocked &= ~far
    if here_m < hard_m:
        blocked &= (clearance_m < here_m - grid.cell_m / 2) | (away_m > LEAVE_M)
    cost[blocked] = BLOCKED
    return Costmap(grid, cost)


def _swept(clearance_m: F64, grid: GridMap, view: View) -> None:
    """Cells that what moves is about to sweep are near something as well."""
    hazards = view.percept.hazard_ne_m
    if len(hazards) == 0:
        return
    north, east = centres(grid)
    for hazard in hazards:
        np.minimum(clearance_m, np.hypot((north - hazard[0])[:, None], (east - hazard[1])[None, :]), out=clearance_m)


def straightened(path: F64, costmap: Costmap) -> F64:
    """From each vertex on to the farthest one that a straight line reaches at the cost of the way there."""
    spent = np.concatenate([[0.0], np.cumsum([_cost(costmap, path[k], path[k + 1]) for k in range(len(path) - 1)])])
    kept = [0]
    while kept[-1] < len(path) - 1:
        here = kept[-1]
        there = here + 1
        for k in range(min(len(path) - 1, here + LOOK), here + 1, -1):
            if _cost(costmap, path[here], path[k]) <= DEARER * (spent[k] - spent[here]):
                there = k
                break
        kept.append(there)
    return path[kept]


def _cost(costmap: Costmap, a: F64, b: F64) -> float:
    """Of a straight line, in metres."""
    grid, length = costmap.grid, math.dist(a.tolist(), b.tolist())
    count = max(2, math.ceil(SAMPLES_PER_CELL * length / grid.cell_m))
    places = a + (np.arange(count)[:, None] + 0.5) / count * (b - a)
    n = len(costmap.cost)
    cells = np.clip(np.floor(places / grid.cell_m).astype(np.intp) - np.array(grid.corner), 0, n - 1)
    return length * float(costmap.cost[cells[:, 0], cells[:, 1]].mean())


def _cell(grid: GridMap, place_ne_m: F64) -> int:
    n = len(grid.free_t)
    row = math.floor(float(place_ne_m[0]) / grid.cell_m) - grid.corner[0]
    column = math.floor(float(place_ne_m[1]) / grid.cell_m) - grid.corner[1]
    return min(max(row, 0), n - 1) * n + min(max(column, 0), n - 1)


@lru_cache(maxsize=4)
def _rim(n: int) -> NDArray[np.intp]:
    rim = np.ones((n, n), bool)
    rim[RIM_CELLS:-RIM_CELLS, RIM_CELLS:-RIM_CELLS] = False
    return np.flatnonzero(rim)
