"""Which is the cheapest way where cells are finer than a search has time for? One place a block of cells; pure.

Each block stands for its cheapest cell. A way from block to block is paid at both of these cells and at the one half
way, and none may be blocked: what is blocked over two cells is not jumped, and gaps of one cell are found.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64
from companion.policy.grid_path import Cells, Reach, reach_by, walk_back

Index = NDArray[np.int32]
QUARTER_LENGTH = np.sqrt(np.arange(800)) / 4.0  # by its square, of what lies between neighbouring blocks


@dataclass(frozen=True, slots=True)
class Blocks:
    """A grid of n cells a side seen as m blocks a side; lengths and costs are those of the cells."""

    cell_cost: F64  # (n, n)
    size: int  # cells along a block's side
    row: Index  # (m, m) of the cell that stands for the block
    column: Index
    cost: F64  # (m, m) of that cell


def in_blocks(cell_cost: F64, size: int, fixed: tuple[int, ...]) -> Blocks:
    """Blocks of ``size`` cells a side, which must divide the grid's; ``fixed`` cells (flat) stand for their blocks."""
    n = len(cell_cost)
    m = n // size
    parts = cell_cost.reshape(m, size, m, size).swapaxes(1, 2).reshape(m, m, size * size)
    which = parts.argmin(axis=2).astype(np.int32)
    for cell in fixed:
        row, column = divmod(cell, n)
        which[row // size, column // size] = row % size * size + column % size
    first = np.arange(m, dtype=np.int32) * size
    row, column = first[:, None] + which // size, first[None, :] + which % size
    return Blocks(cell_cost, size, row, column, cell_cost[row, column])


def cells_of_blocks(blocks: Blocks) -> Index:
    """(m, m) flat index of the cell that stands for each block."""
    cells: Index = blocks.row * np.int32(len(blocks.cell_cost)) + blocks.column
    return cells


def block_of(blocks: Blocks, cell: int) -> int:
    """Flat index of the block that holds a cell."""
    row, column = divmod(cell, len(blocks.cell_cost))
    return row // blocks.size * len(blocks.cost) + column // blocks.size


def reach_over(blocks: Blocks, source: int, ahead: F64, detour: float) -> Reach:
    """Cheapest ways from block to block; as ``reach_from``, ``source`` a block, ``ahead`` (m, m) of their cells."""

    def way(here: Cells, there: Cells, _length: float) -> F64:
        row, column = blocks.row[here], blocks.column[here]
        to_row, to_column = blocks.row[there], blocks.column[there]
        low, high = _half_way(blocks, row, column, to_row, to_column)
        cost: F64 = np.minimum(blocks.cell_cost.take(low), blocks.cell_cost.take(high))
        cost *= 2.0
        cost += blocks.cost[here]
        cost += blocks.cost[there]
        row, column = row - to_row, column - to_column
        cost *= QUARTER_LENGTH.take(row * row + column * column)
        return cost

    return reach_by(way, source, ahead, detour)


def cells_back(blocks: Blocks, reach: Reach, target: int) -> list[int]:
    """Flat cells from the source's to that of the block ``target``, with those half way between blocks."""
    path = walk_back(reach, target)
    row, column = blocks.row.take(path), blocks.column.take(path)
    cells = np.repeat(row * np.int32(len(blocks.cell_cost)) + column, 2)[:-1]
    low, high = _half_way(blocks, row[:-1], column[:-1], row[1:], column[1:])
    cells[1::2] = np.where(blocks.cell_cost.take(high) < blocks.cell_cost.take(low), high, low)
    return [int(cells[0]), *cells[1:][np.diff(cells) != 0].tolist()]


def _half_way(blocks: Blocks, row: Index, column: Index, to_row: Index, to_column: Index) -> tuple[Index, Index]:
    """Flat index of the cell half way between two; both of them where two cells share the place."""
    n = np.int32(len(blocks.cell_cost))
    row, column = row + to_row, column + to_column
    return (row >> 1) * n + (column >> 1), ((row + 1) >> 1) * n + ((column + 1) >> 1)
