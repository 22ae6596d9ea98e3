"""Clearance field and cheapest ways of the planner, each against the plainest other way to work it out."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core import gridmap
from companion.core.gridmap import MapParams
from companion.core.types import F64
from companion.policy.grid_path import BLOCKED, LIMIT, clearance_field, reach_from, walk_back

SIDE = 9
STEPS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
CELL = st.integers(0, SIDE * SIDE - 1)
costs = arrays(np.float64, (SIDE, SIDE), elements=st.one_of(st.floats(1.0, 20.0), st.just(BLOCKED)))


def plain_dijkstra(cost: F64, source: int) -> F64:
    """Priority queue over the eight neighbours; an edge costs its length times the mean cost of its ends."""
    n = cost.shape[0]
    best = np.full(n * n, math.inf)
    best[source] = 0.0
    queue = [(0.0, source)]
    while queue:
        spent, cell = heapq.heappop(queue)
        if spent > best[cell]:
            continue
        for di, dj in STEPS:
            i, j = cell // n + di, cell % n + dj
            if 0 <= i < n and 0 <= j < n:
                total = spent + math.hypot(di, dj) * (cost[cell // n, cell % n] + cost[i, j]) / 2
                if total < best[i * n + j]:
                    best[i * n + j] = total
                    heapq.heappush(queue, (total, i * n + j))
    return np.where(best > LIMIT, math.inf, best)


def open_at(cost: F64, source: int) -> F64:
    cost = cost.copy()
    cost.ravel()[source] = 1.0
    return cost


def cells_to(goal: int) -> F64:
    """Straight distance in cells from everywhere to a cell."""
    row, column = np.indices((SIDE, SIDE))
    distance: F64 = np.hypot(row - goal // SIDE, column - goal % SIDE)
    return distance


@settings(max_examples=60, deadline=None)
@given(costs, CELL, CELL)
def test_costs_are_those_of_a_plain_dijkstra_wherever_the_goal_lies(cost: F64, source: int, goal: int) -> None:
    cost = open_at(cost, source)
    reach = reach_from(cost, source, cells_to(goal), LIMIT)
    assert reach.cost == pytest.approx(plain_dijkstra(cost, source), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(costs, CELL, CELL, st.floats(0.5, 60.0))
def test_a_bound_on_the_detour_leaves_out_only_what_is_beyond_it(
    cost: F64, source: int, goal: int, detour: float
) -> None:
    cost, ahead = open_at(cost, source), cells_to(goal)
    reach, all_of_it = reach_from(cost, source, ahead, detour), plain_dijkstra(cost, source)
    within = all_of_it + ahead.ravel() < detour + ahead.ravel()[source] - 1e-6
    assert reach.cost[within] == pytest.approx(all_of_it[within])
    left = np.isfinite(reach.cost)
    assert reach.cost[left] == pytest.approx(all_of_it[left], abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(costs, CELL, CELL)
def test_walking_back_gives_a_path_of_neighbours_that_costs_what_was_said(cost: F64, source: int, target: int) -> None:
    cost = open_at(cost, source)
    reach = reach_from(cost, source, cells_to(target), LIMIT)
    path = walk_back(reach, target)
    if not math.isfinite(reach.cost[target]):
        assert path == [target]
        return
    assert (path[0], path[-1]) == (source, target)
    row, column = np.divmod(path, SIDE)
    steps = np.stack([np.diff(row), np.diff(column)])
    assert np.abs(steps).max(initial=1) == 1
    cells = cost.ravel()[path]
    said = (np.hypot(*steps) * (cells[1:] + cells[:-1]) / 2).sum()
    assert said == pytest.approx(reach.cost[target], abs=1e-9)


def test_blocked_cells_are_never_walked_and_what_they_enclose_is_out_of_reach() -> None:
    cost, target = np.ones((SIDE, SIDE)), 8 * SIDE
    cost[4, :] = BLOCKED
    reach = reach_from(cost, 0, cells_to(target), LIMIT)
    assert np.isfinite(reach.cost.reshape(SIDE, SIDE)[:4]).all()
    assert not np.isfinite(reach.cost.reshape(SIDE, SIDE)[4:]).any()
    cost[4, 8] = 1.0
    path = walk_back(reach_from(cost, 0, cells_to(target), LIMIT), target)
    assert 4 * SIDE + 8 in path
    assert (cost.ravel()[path] == 1.0).all()


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-3.9, 3.9), st.floats(-3.9, 3.9)), min_size=1, max_size=12))
def test_clearance_is_the_distance_to_the_nearest_hit_to_within_a_cell(hits: list[tuple[float, float]]) -> None:
    grid = gridmap.empty(MapParams(cells=40))
    cells, inside = gridmap.cells_of(grid, np.array(hits))
    assert inside.all()
    grid.hit_t.ravel()[cells] = 1.0
    grid.hit_ne_m.reshape(-1, 2)[cells] = hits
    field = clearance_field(grid, grid.hit_t > gridmap.NEVER)
    north, east = gridmap.centres(grid)
    kept = grid.hit_ne_m.reshape(-1, 2)[np.unique(cells)]
    away = np.hypot(north[:, None, None] - kept[:, 0], east[None, :, None] - kept[:, 1]).min(axis=2)
    assert (field >= away - 1e-5).all()  # of the hit in the nearest cell: never less than the truth
    assert (field <= away + math.sqrt(2) * grid.cell_m + 1e-5).all()
    exact = field.ravel()[cells]
    assert (exact <= math.sqrt(0.5) * grid.cell_m + 1e-5).all()


def test_without_hits_every_place_is_clear() -> None:
    grid = gridmap.empty(MapParams(cells=40))
    assert np.isinf(clearance_field(grid, grid.hit_t > gridmap.NEVER)).all()
