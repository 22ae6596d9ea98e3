"""Which held-out world belongs to this seed? Our own cellular automaton, after the facts that BARN gives of its own.

A field of 30 x 30 cells of 0.15 m between two walls, a walled box of 5 m before it; a cell is a cylinder of 0.075 m, so
geometry, start, goal and rules are BARN's, but no world is. Fifty seeds are frozen by a hash of what they give: flown
once, never looked at while tuning.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve2d

from companion.core.types import F64
from mission.bench.barn import BOUNDS, FIELD, FINE_M, GOAL, RULES, START
from mission.world_check import WorldError, check_world
from mission.world_generator import hash_of
from sitl.world import World

SIDE: Final = 30  # cells
CELL_M: Final = 0.15
CYLINDER_M: Final = 0.075
FILLS: Final = (0.15, 0.20, 0.25, 0.30)
ITERATIONS: Final = (2, 3, 4)
BIRTH, DEATH = 5, 1  # filled neighbours of eight from which a cell is filled, and up to which it is emptied
BOX_CELLS: Final = 33  # of the walled box before the field
SOUTH_M: Final = 5.075  # north of the first row of the field
WEST_M: Final = -4.425  # east of the first column
SPARE_M: Final = 0.02  # of the narrowest way, to either side
FIRST_SEED: Final = 50_000
COUNT: Final = 50


@dataclass(frozen=True, slots=True)
class HeldOut:
    """The frozen fifty."""

    seeds: tuple[int, ...]
    sha256: str

    def worlds(self) -> Iterator[World]:
        """Each world, in the order of the seeds."""
        return map(generate, self.seeds)


def generate(seed: int) -> World:
    """The world of a seed. Raises WorldError where no way leads through it."""
    rng = np.random.default_rng(seed)
    fill, iterations = FILLS[seed % len(FILLS)], ITERATIONS[seed // len(FILLS) % len(ITERATIONS)]
    places = cylinders(rng, fill, iterations)
    circles = np.column_stack([places, np.full(len(places), CYLINDER_M), np.full(len(places), np.inf)])
    world = World(f"cells_{seed}", np.array(START), np.array(GOAL), FIELD, circles, np.empty((0, 6)))
    check_world(world, RULES.radius_m, SPARE_M, FINE_M)
    return World(world.name, world.start_ned_m, world.goal_ned_m, BOUNDS, circles, world.boxes)


def cylinders(rng: np.random.Generator, fill: float, iterations: int) -> F64:
    """Where they stand (k, 2): a field that was drawn so full and smoothed so often, and the box before it."""
    filled = rng.uniform(size=(SIDE, SIDE)) < fill
    for _ in range(iterations):
        filled = smoothed(filled)
    return np.concatenate([_field(filled), _box()])


def smoothed(filled: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """One step of the automaton (rows north, columns east); beside the field counts as filled, before it as empty."""
    padded = np.zeros((SIDE + 2, SIDE + 2), dtype=np.int64)
    padded[1:-1, 1:-1] = filled
    padded[:, 0] = padded[:, -1] = 1
    neighbours = convolve2d(padded, np.ones((3, 3), dtype=np.int64), mode="valid") - filled
    grown: NDArray[np.bool_] = (neighbours >= BIRTH) | (filled & (neighbours > DEATH))
    grown[:, 0] = grown[:, -1] = True
    return grown


def held_out() -> HeldOut:
    """The frozen seeds and the hash of their worlds."""
    text = (resources.files("mission") / "worlds" / "heldout50.json").read_text(encoding="utf-8")
    data = json.loads(text)
    return HeldOut(tuple(data["seeds"]), data["sha256"])


def freeze() -> HeldOut:
    """The first fifty seeds that have a way through; changing them makes results before and after incomparable."""
    seeds: list[int] = []
    worlds: list[World] = []
    seed = FIRST_SEED
    while len(seeds) < COUNT:
        try:
            worlds.append(generate(seed))
            seeds.append(seed)
        except WorldError:
            pass  # no way through: the next seed
        seed += 1
    return HeldOut(tuple(seeds), hash_of(worlds))


def _field(filled: NDArray[np.bool_]) -> F64:
    """Centres (k, 2) of the filled cells."""
    places: F64 = np.array([SOUTH_M, WEST_M]) + CELL_M * np.argwhere(filled)
    return places


def _box() -> F64:
    """Two side walls and the wall behind the start."""
    south = SOUTH_M - CELL_M * np.arange(1, BOX_CELLS + 1)
    east = WEST_M + CELL_M * np.arange(SIDE)
    sides = [np.column_stack([south, np.full(BOX_CELLS, edge)]) for edge in (east[0], east[-1])]
    behind = np.column_stack([np.full(SIDE, south[-1] - CELL_M), east])
    whole: F64 = np.concatenate([*sides, behind])
    return whole
