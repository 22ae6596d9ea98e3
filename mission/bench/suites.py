"""What is in each suite? Cells, worlds, rules: everything that two people must agree on before they compare figures.

A suite is a list of cells; a cell makes the course of each of its runs from the run's number alone, so that every pilot
flies the same. Figures from the literature stand where they are used, with what they leave open.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from companion.core.params import nearest
from mission.bench import cells, published_sets
from mission.bench.barn import FINE_M, load_barn
from mission.bench.barn import RULES as BARN_RULES
from mission.bench.course import Course, Rules, Skipped
from mission.errors import InputError
from mission.mission_file import load_mission
from mission.shortest_path import shortest_path_m
from mission.world_file import load_world
from sitl.world import World

FIRST_SEED: Final = 20_000  # of worlds that the run's number draws
FOREST_PER_M2: Final = {"1/49": 1 / 49, "1/36": 1 / 36, "1/25": 1 / 25}
FOREST_M_S: Final = (3.0, 5.0, 7.0, 10.0, 12.0)
GAP_M_S: Final = (3.0, 5.0, 7.0)
POLE_M_S: Final = (3.0, 5.0, 7.0, 10.0)
YARDS: Final = {"static 70": (70, 0), "moving 60": (0, 60), "mixed 20+40": (20, 40)}
# 6 m at 15 Hz: 68 ms is the next whole number of physics steps above 1/15 s. High enough that a tilted sweep meets the
# ground beyond its range.
LOQUERCIO: Final = Rules(
    speed_m_s=3.0,
    radius_m=published_sets.RADIUS_M,
    time_limit_s=60.0,
    goal_radius_m=None,
    altitude_m=5.0,
    range_m=6.0,
    rate_hz=1.0 / 0.068,
)
ONE_SET: Final[dict[str, Any]] = {"profile": ""}  # parameters chosen for a suite fly all of it
# What an opening of 0.8 m asks of a sphere of 0.2 m: cells finer than the room to spare, margins that fit in, no
# corners cut; and where to look in a wall that shows none.
NARROW: Final[dict[str, dict[str, Any]]] = {
    "map": {"cell_m": 0.12},
    "expert": {"margin_m": 0.10, "tight_m": 0.03, "wall_m": 3.0},
    "follower": {"off_path_m": 0.05, "off_path_gain_1_m": 5.0, "off_path_share": 0.2},
    "limits": {"corner_cut_m": 0.06},
    "tight": ONE_SET,
}
# As quick as the vehicle is: 6 m/s2 of the 6.9 that its tilt leaves, and what a stop comes too late for is passed.
POLE_PARAMS: Final[dict[str, dict[str, Any]]] = {"limits": {"swerve_m_s2": 6.5}, "tight": ONE_SET}
FOREST_PARAMS: Final[dict[str, dict[str, Any]]] = {
    "tight": ONE_SET,
    "arbiter": {"s_enter": 0.995, "s_exit": 0.999, "d_enter_m": 6.0, "d_exit_m": 6.5},  # nothing is seen from afar
    "expert": {"comfort_m": 0.8, "margin_m": 0.35, "tight_m": 0.2},
    "checker": {"margin_full_m": 0.3, "margin_reduced_m": 0.2, "margin_least_m": 0.12},
    "follower": {"acc_max_m_s2": 6.0},
    "limits": {
        "brake_m_s2": 6.0,
        "end_gain_1_s": 3.0,
        "lateral_m_s2": 5.0,
        "rise_m_s2": 4.0,
        "corner_cut_m": 0.3,
        "corner_share": 0.6,
        "side_full_m": 0.3,
        "fuzzy_share": 1.0,
        "stop_margin_m": 0.1,
        "swerve_m_s2": 6.0,
    },
}
# As profile 'crowd': no speed from which the vehicle would not stand before what moves can be where it is; and out of
# the way of what comes nearer than that.
YARD_PARAMS: Final[dict[str, dict[str, Any]]] = {
    "tight": ONE_SET,
    "movers": {"again_m": 0.45, "link_m": 0.5, "ahead_s": 1.5},
    "yielding": {"ahead_s": 3.0, "weight_m": 10.0, "dodge": True},
}
YARD_RULES: Final = Rules(
    speed_m_s=2.0,
    radius_m=published_sets.YARD_RADIUS_M,
    time_limit_s=60.0,
    goal_radius_m=1.0,
    range_m=4.0,
    params=YARD_PARAMS,
)
TRACK_GOAL_M: Final = 1.0
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Cell:
    """Runs that are counted together; ``course`` is a pure function of the run's number."""

    name: str
    course: Callable[[int], Course]


@dataclass(frozen=True, slots=True)
class Suite:
    """What ``swiftnav bench NAME`` flies."""

    name: str
    text: str
    cells: tuple[Cell, ...]
    runs: int  # of each cell, unless asked otherwise
    skipped: tuple[Skipped, ...] = ()

    def only(self, text: str) -> "Suite":
        """The suite with the cells that have ``text`` in their names. Raises InputError where none has."""
        chosen = tuple(cell for cell in self.cells if text in cell.name)
        if not chosen:
            names = ", ".join(f"'{cell.name}'" for cell in self.cells)
            raise InputError(f"--cell '{text}': suite '{self.name}' has {names}")
        return replace(self, cells=chosen)


def suite_names() -> list[str]:
    """In the order of the report."""
    return list(_MAKERS)


def suite_named(name: str, folder: Path | None = None, part: str = "all") -> Suite:
    """The suite of that name; ``folder`` holds BARN's worlds, ``part`` says which of them. Raises InputError."""
    if name not in _MAKERS:
        raise InputError(f"unknown suite '{name}'{nearest(name, suite_names())}")
    return _MAKERS[name](folder, part)


def _tracks(_folder: Path | None, _part: str) -> Suite:
    text = "the two trajectories of the paper, in the air, to within 1 m of the goal"
    return Suite("tracks", text, tuple(Cell(n, partial(_track, n)) for n in ("trajectory1", "trajectory2")), 50)


def _track(name: str, run: int) -> Course:
    mission = load_mission(name)
    world = load_world(mission.world or name, mission.start, mission.goal)
    rules = Rules(
        speed_m_s=mission.cruise_m_s,
        radius_m=0.33,
        time_limit_s=mission.success.time_limit_s,
        goal_radius_m=TRACK_GOAL_M,
        jitter_m=mission.spawn_jitter_m,
    )
    offset = world.goal_ned_m - world.start_ned_m
    return Course(
        name, world.name, world.seeded(FIRST_SEED + run), rules, None, float(np.arctan2(offset[1], offset[0]))
    )


def _barn(folder: Path | None, part: str) -> Suite:
    if folder is None:
        raise InputError("suite 'barn' wants a folder with the worlds: swiftnav bench barn FOLDER")
    barn = load_barn(folder)
    chosen = PARTS[part](barn.courses) if part in PARTS else None
    if chosen is None:
        raise InputError(f"--part '{part}' is unknown{nearest(part, list(PARTS))}")
    if not chosen:
        raise InputError(f"--part {part}: none of {len(barn.courses)} worlds in '{folder}' belongs to it")
    text = f"BARN worlds, BARN formula, own vehicle: {len(chosen)} worlds ({part}), disc of 0.33 m, 2 m/s"
    return Suite("barn", text, (Cell("barn", partial(_nth, spread(chosen))),), 150, barn.skipped)


def _number(course: Course) -> int:
    return int(course.name.rpartition("_")[2])


PARTS: Final[dict[str, Callable[[tuple[Course, ...]], tuple[Course, ...]]]] = {
    "all": lambda courses: courses,
    "tuning": lambda courses: tuple(c for c in courses if _number(c) % 6 != 3),
    "kept": lambda courses: tuple(c for c in courses if _number(c) % 6 == 3),  # never tuned on
}


def spread(courses: tuple[Item, ...]) -> tuple[Item, ...]:
    """The same items in an order in which every first few are spread over all of them."""
    golden = (5.0**0.5 - 1.0) / 2.0
    order = sorted(range(len(courses)), key=lambda i: (i * golden) % 1.0)
    return tuple(courses[i] for i in order)


def _nth(courses: tuple[Course, ...], run: int) -> Course:
    return courses[run % len(courses)]


def _forest(_folder: Path | None, _part: str) -> Suite:
    text = "Loquercio et al.: 60 x 30 m, Poisson, trunks of 0.6 m, to 40 m north; sphere of 0.2 m, sensing 6 m"
    made = tuple(
        Cell(f"{name} at {speed:g} m/s", partial(_forest_course, name, speed))
        for name in FOREST_PER_M2
        for speed in FOREST_M_S
    )
    return Suite("forest", text, made, 20)


def _forest_course(name: str, speed_m_s: float, run: int) -> Course:
    world = published_sets.forest(FIRST_SEED + run, FOREST_PER_M2[name])
    finish_m = published_sets.FOREST_FINISH_M
    rules = replace(LOQUERCIO, speed_m_s=speed_m_s, finish_north_m=finish_m, measure_from_m=8.0, params=FOREST_PARAMS)
    return _straight(f"{name} at {speed_m_s:g} m/s", world, rules)


def _gap(_folder: Path | None, _part: str) -> Suite:
    text = "Loquercio et al.: a wall of 40 m, 10 m ahead, one opening of 0.8 to 1.0 m up to 5 m off the line"
    return Suite("gap", text, tuple(Cell(f"{v:g} m/s", partial(_gap_course, v)) for v in GAP_M_S), 20)


def _gap_course(speed_m_s: float, run: int) -> Course:
    finish_m = 1.5 * published_sets.GAP_AHEAD_M
    rules = replace(LOQUERCIO, speed_m_s=speed_m_s, finish_north_m=finish_m, time_limit_s=40.0, params=NARROW)
    return _straight(f"{speed_m_s:g} m/s", published_sets.gap(FIRST_SEED + run), rules)


def _pole(_folder: Path | None, _part: str) -> Suite:
    text = "Loquercio et al.: a pole of 1.5 m, its middle 6 m ahead of a vehicle that starts at speed"
    return Suite("pole", text, tuple(Cell(f"{v:g} m/s", partial(_pole_course, v)) for v in POLE_M_S), 20)


def _pole_course(speed_m_s: float, run: int) -> Course:
    finish_m = 2.0 * published_sets.POLE_AHEAD_M
    rules = replace(
        LOQUERCIO,
        speed_m_s=speed_m_s,
        finish_north_m=finish_m,
        time_limit_s=30.0,
        at_speed=True,
        jitter_m=0.1,
        params=POLE_PARAMS,
    )
    return _straight(f"{speed_m_s:g} m/s", published_sets.pole(FIRST_SEED + run), rules)


def _straight(cell: str, world: World, rules: Rules) -> Course:
    """North, and on beyond the finish."""
    finish_m = 0.0 if rules.finish_north_m is None else rules.finish_north_m
    sent_to = np.array([finish_m + published_sets.BEYOND_M, 0.0])
    return Course(cell, world.name, world, rules, task_goal_ned_m=sent_to)


def _dynamic(_folder: Path | None, _part: str) -> Suite:
    text = "20 x 20 m with 70 standing, 60 moving, or 20 and 40; 0.5 to 1.5 m/s; LiDAR 4 m, 2 m/s"
    return Suite("dynamic", text, tuple(Cell(name, partial(_yard_course, name)) for name in YARDS), 50)


def _yard_course(name: str, run: int) -> Course:
    world = published_sets.yard(FIRST_SEED + run, *YARDS[name])
    return Course(name, world.name, world, YARD_RULES)


def _heldout(_folder: Path | None, _part: str) -> Suite:
    text = "50 worlds of our own cellular automaton under BARN's rules; the shortest way stands for the reference path"
    return Suite("heldout", text, (Cell("heldout", _heldout_course),), cells.COUNT)


def _heldout_course(run: int) -> Course:
    seeds = cells.held_out().seeds
    world = cells.generate(seeds[run % len(seeds)])
    length_m = shortest_path_m(world, world.start_ned_m, world.goal_ned_m, BARN_RULES.radius_m, FINE_M)
    return Course("heldout", world.name, world, BARN_RULES, length_m)


_MAKERS: Final[dict[str, Callable[[Path | None, str], Suite]]] = {
    "tracks": _tracks,
    "barn": _barn,
    "forest": _forest,
    "gap": _gap,
    "pole": _pole,
    "dynamic": _dynamic,
    "heldout": _heldout,
}
