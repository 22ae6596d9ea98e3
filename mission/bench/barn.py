"""Which BARN worlds has the user, and can they be flown? Reads the SDF worlds and reference paths from a folder.

The worlds are not part of this project. ``world_<i>.world`` and ``path_<i>.npy`` may lie anywhere below the folder.
BARN's x is our east, its y our north; its cylinders count as taller than any flight.
"""

import dataclasses
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from companion.core.types import F64
from mission.bench.course import Course, Rules, Skipped
from mission.bench.sdf import Obstacles, read_sdf
from mission.errors import InputError
from mission.world_check import WorldError, check_world
from sitl.world import World

START: Final = (3.0, -2.25)  # north, east; facing north
GOAL: Final = (13.0, -2.25)
BOUNDS: Final = (-1.0, -9.0, 16.0, 4.5)  # wider than the field, which is walled on three sides
FIELD: Final = (2.0, -5.5, 14.0, 1.0)  # where a way is looked for: the open ground round it makes none
CELL_M: Final = 0.15  # of the reference path: cell (row, column) is x = .15 row - 4.575, y = .15 column + 5.075
ORIGIN_M: Final = (5.075, -4.575)  # north of column 0, east of row 0
FINE_M: Final = 0.025  # cells of the search for a way: gaps are a few centimetres wider than the vehicle
RULES: Final = Rules(speed_m_s=2.0, radius_m=0.33, time_limit_s=100.0, goal_radius_m=1.0)
_WORLD = re.compile(r"world_(\d+)\.(world|sdf)")


@dataclass(frozen=True, slots=True)
class Barn:
    """What was found."""

    courses: tuple[Course, ...]  # in the order of their numbers
    skipped: tuple[Skipped, ...]


def load_barn(folder: Path) -> Barn:
    """Every world below ``folder`` that can be flown, and the others with the reason.

    Raises InputError where there is no such folder, no world in it, or none that can be flown.
    """
    if not folder.is_dir():
        raise InputError(f"BARN: '{folder}' is no folder")
    files = {int(found[1]): path for path in folder.rglob("*") if (found := _WORLD.fullmatch(path.name))}
    if not files:
        raise InputError(f"BARN: no world_<number>.world below '{folder}'")
    paths = {path.name: path for path in folder.rglob("path_*.npy")}
    courses: list[Course] = []
    skipped: list[Skipped] = []
    for number, file in sorted(files.items()):
        try:
            courses.append(_course(number, read_sdf(file), paths.get(f"path_{number}.npy")))
        except WorldError as error:
            skipped.append(Skipped(file.name, str(error)))
    if not courses:
        raise InputError(f"BARN: none of {len(files)} worlds can be flown; the first: {skipped[0].reason}")
    return Barn(tuple(courses), tuple(skipped))


def reference_length_m(cells: F64) -> float:
    """Length of the reference path from start to goal, through its cells (n, 2: row, column)."""
    places = np.column_stack([ORIGIN_M[0] + CELL_M * cells[:, 1], ORIGIN_M[1] + CELL_M * cells[:, 0]])
    whole = np.concatenate([[START], places, [GOAL]])
    return float(np.hypot(*np.diff(whole, axis=0).T).sum())


def _course(number: int, obstacles: Obstacles, path: Path | None) -> Course:
    world = World(f"barn_{number}", np.array(START), np.array(GOAL), BOUNDS, obstacles.circles, obstacles.boxes)
    check_world(dataclasses.replace(world, bounds_m=FIELD), RULES.radius_m, 0.0, FINE_M)
    if path is None:
        raise WorldError(f"barn_{number}: path_{number}.npy is missing: the score is made of the reference path")
    return Course("barn", world.name, world, RULES, _length_of(path))


def _length_of(path: Path) -> float:
    try:
        cells = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise WorldError(f"{path.name} is no NumPy array: {error}") from error
    if cells.ndim != 2 or cells.shape[1] != 2 or len(cells) == 0 or not np.issubdtype(cells.dtype, np.number):
        raise WorldError(f"{path.name}: rows of (row, column) are wanted, got shape {cells.shape}")
    if not np.isfinite(cells).all():
        raise WorldError(f"{path.name} holds a number that is not finite")
    return reference_length_m(cells.astype(np.float64))
