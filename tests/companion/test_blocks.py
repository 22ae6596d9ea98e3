"""The search over blocks of cells: never through what is blocked, never far from the cheapest, gaps of a cell found."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core.types import F64
from companion.policy.blocks import (
    Blocks,
    block_of,
    cells_back,
    cells_of_blocks,
    in_blocks,
    reach_over,
)
from companion.policy.grid_path import BLOCKED, LIMIT, reach_from

SIDE = 12
CELL = st.integers(0, SIDE * SIDE - 1)
costs = arrays(np.float64, (SIDE, SIDE), elements=st.one_of(st.floats(1.0, 20.0), st.just(BLOCKED)))


def cells_to(goal: int) -> F64:
    row, column = np.indices((SIDE, SIDE))
    distance: F64 = np.hypot(row - goal // SIDE, column - goal % SIDE)
    return distance


def open_at(cost: F64, *cells: int) -> F64:
    cost = cost.copy()
    cost.ravel()[list(cells)] = 1.0
    return cost


def way(cost: F64, source: int, goal: int, size: int) -> tuple[list[int], float]:
    """Cells from source to goal over blocks, and what they cost; none where there is no way."""
    blocks: Blocks = in_blocks(cost, size, (source, goal))
    ahead = cells_to(goal).take(cells_of_blocks(blocks))
    reach = reach_over(blocks, block_of(blocks, source), ahead, LIMIT)
    target = block_of(blocks, goal)
    spent = float(reach.cost[target])
    return (cells_back(blocks, reach, target), spent) if math.isfinite(spent) else ([], spent)


@settings(max_examples=80, deadline=None)
@given(costs, CELL, CELL, st.sampled_from([2, 3]))
def test_a_way_leads_from_source_to_goal_over_open_cells_in_short_steps(
    cost: F64, source: int, goal: int, size: int
) -> None:
    cost = open_at(cost, source, goal)
    blocks = in_blocks(cost, size, (source, goal))
    if block_of(blocks, source) == block_of(blocks, goal):
        return
    cells, _ = way(cost, source, goal, size)
    if not cells:
        return
    assert (cells[0], cells[-1]) == (source, goal)
    assert (cost.ravel()[cells] < BLOCKED).all()
    row, column = np.divmod(cells, SIDE)
    assert max(np.abs(np.diff(row)).max(), np.abs(np.diff(column)).max()) <= size


@settings(max_examples=40, deadline=None)
@given(arrays(np.float64, (SIDE, SIDE), elements=st.floats(1.0, 3.0)), CELL, CELL)
def test_in_the_open_a_way_is_not_much_dearer_than_that_over_cells(cost: F64, source: int, goal: int) -> None:
    blocks = in_blocks(cost, 2, (source, goal))
    if block_of(blocks, source) == block_of(blocks, goal):
        return
    cells, _ = way(cost, source, goal, 2)
    places = np.stack(np.divmod(cells, SIDE), axis=1)
    lengths = np.hypot(*np.diff(places, axis=0).T)
    values = cost.ravel()[cells]
    spent = float(lengths @ (values[1:] + values[:-1]) / 2)
    assert spent <= 1.6 * float(reach_from(cost, source, cells_to(goal), LIMIT).cost[goal]) + 6.0


def test_a_gap_of_a_single_cell_through_a_thick_wall_is_found_wherever_it_is() -> None:
    for row in (3, 4):
        for gap in range(SIDE):
            cost = np.ones((SIDE, SIDE))
            cost[row : row + 4] = BLOCKED
            cost[row : row + 4, gap] = 4.0
            cells, _ = way(cost, 0, SIDE * SIDE - 1, 2)
            assert (row + 1) * SIDE + gap in cells or (row + 2) * SIDE + gap in cells, (row, gap)


def test_a_wall_of_two_cells_is_not_jumped() -> None:
    for row in range(1, SIDE - 2):
        cost = np.ones((SIDE, SIDE))
        cost[row : row + 2] = BLOCKED
        assert way(cost, 0, SIDE * SIDE - 1, 2)[0] == []
