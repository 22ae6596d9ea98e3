"""In which random worlds is a policy trained, validated, tested? Seeded distributions, declared in ``KINDS``.

A world belongs to (kind, split, index): splits never share a world, and none is one of the frozen acceptance worlds.
Every world is checked for a way that the vehicle fits through; where there is none the next draw of the same seed is
taken. Start at the origin, goal north of it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Protocol

import numpy as np

from companion.core.params import nearest
from mission.errors import InputError
from mission.training import world_parts as parts
from mission.training.world_parts import Site
from mission.world_check import RADIUS_M, WorldError, check_world
from mission.world_file import list_worlds, load_world
from sitl.world import World

SPLITS = ("train", "validation", "test")
SPLIT_SIZE = 1_000_000  # indices of a split: [0, SPLIT_SIZE)
TRIES = 50
FEW = 10  # worlds whose shortest ways are worked out
DENSITY_PER_M2 = (0.04, 0.15)  # trees of a forest
TABLE_PER_M2 = (0.04, 0.08, 0.12, 0.15)  # of forests for tables: kinds forest04 to forest15
SPARSE_PER_M2 = (0.03, 0.08)  # trees round a barrier


def forest(rng: np.random.Generator) -> Site:
    """Trunks of 0.6 m, 0.04 to 0.15 a square metre."""
    return trunks(rng.uniform(*DENSITY_PER_M2), rng)


def trunks(density_per_m2: float, rng: np.random.Generator) -> Site:
    """Trunks of 0.6 m, so many a square metre."""
    return parts.with_trees(parts.yard(), rng, density_per_m2, (0.3, 0.3))


def clutter(rng: np.random.Generator) -> Site:
    """Trees of any girth, boxes and pieces of wall."""
    site = parts.with_blocks(parts.yard(), rng, rng.uniform(0.005, 0.02))
    return parts.with_trees(site, rng, rng.uniform(*SPARSE_PER_M2), (0.15, 0.6))


def barrier(rng: np.random.Generator) -> Site:
    """A concave arc across the line: R 4-9 m, half angle 40-80 deg, turned by 25 deg, shifted by 4 m at most."""
    site = parts.with_arc(parts.yard(), rng, top_m=rng.uniform(20.0, 32.0))
    return _sparsely_wooded(site, rng)


def deep(rng: np.random.Generator) -> Site:
    """An arc hard to leave: R 6-9 m, half angle 70-90 deg, right on the line."""
    arc = parts.ArcDraw(radius_m=(6.0, 9.0), half_deg=(70.0, 90.0), shift_m=0.0)
    site = parts.with_arc(parts.yard(), rng, top_m=rng.uniform(20.0, 32.0), draw=arc)
    return _sparsely_wooded(site, rng)


def two(rng: np.random.Generator) -> Site:
    """Two arcs in a row."""
    site = parts.with_arc(parts.yard(), rng, top_m=rng.uniform(15.0, 19.0))
    site = parts.with_arc(site, rng, top_m=rng.uniform(36.0, 40.0))
    return _sparsely_wooded(site, rng)


def rows(rng: np.random.Generator) -> Site:
    """Two rows of clusters across the way, with gaps of 1.2 to 1.8 m, a few trees round them."""
    site = parts.yard()
    for north_m in (rng.uniform(15.0, 23.0), rng.uniform(32.0, 44.0)):
        site = parts.with_row(site, rng, north_m, gap_m=(1.2, 1.8))
    return parts.with_trees(site, rng, 0.015, (0.3, 0.45))


def t2like(rng: np.random.Generator) -> Site:
    """Like trajectory2: a fenced garden, a deep arc on the line, rows of clusters with gaps of 1.2 to 1.8 m."""
    arc = parts.ArcDraw(radius_m=(6.0, 8.0), half_deg=(60.0, 80.0), turn_deg=10.0, shift_m=1.5)
    site = parts.with_arc(parts.garden(), rng, top_m=rng.uniform(22.0, 26.0), draw=arc)
    for north_m in (rng.uniform(32.0, 35.0), rng.uniform(42.0, 46.0)):
        site = parts.with_row(site, rng, north_m, gap_m=(1.2, 1.8))
    return parts.with_trees(site, rng, 0.015, (0.3, 0.45))


def pocket(rng: np.random.Generator) -> Site:
    """A rectangular pocket, open to the start: 8-13 m wide, 6-13 m deep. Never trained."""
    site = parts.with_pocket(parts.yard(), rng, width_m=(8.0, 13.0), depth_m=(6.0, 13.0))
    return _sparsely_wooded(site, rng)


def cellular(rng: np.random.Generator) -> Site:
    """A field of 4.5 m full of cylinders by a cellular automaton, a walled box before it: gaps of 0.7 m and wider."""
    return parts.with_cells(parts.box_and_field(), rng)


def mixed(rng: np.random.Generator) -> Site:
    """What the forest policy is trained on."""
    draw = [kind for kind, _ in MIXTURE][rng.choice(len(MIXTURE), p=[share for _, share in MIXTURE])]
    return draw(rng)


MIXTURE: tuple[tuple[Callable[[np.random.Generator], Site], float], ...] = (
    (forest, 0.20),
    (clutter, 0.10),
    (barrier, 0.35),
    (deep, 0.20),
    (rows, 0.15),
)
KINDS: dict[str, Callable[[np.random.Generator], Site]] = {
    "forest": forest,
    "clutter": clutter,
    "barrier": barrier,
    "deep": deep,
    "two": two,
    "rows": rows,
    "t2like": t2like,
    "pocket": pocket,
    "cellular": cellular,
    "mixed": mixed,
    **{f"forest{round(100 * density):02d}": partial(trunks, density) for density in TABLE_PER_M2},
}
TIGHT_KINDS = ("cellular",)  # under BARN's rules


def random_world(kind: str, split: str, index: int, radius_m: float = RADIUS_M) -> World:
    """The world of that kind and number. Raises InputError."""
    if kind not in KINDS:
        raise InputError(f"unknown kind of world '{kind}'{nearest(kind, list(KINDS))}")
    if split not in SPLITS:
        raise InputError(f"unknown split '{split}'{nearest(split, list(SPLITS))}")
    if not 0 <= index < SPLIT_SIZE:
        raise InputError(f"world {index} of '{kind}' is outside [0, {SPLIT_SIZE})")
    seed = SPLITS.index(split) * SPLIT_SIZE + index
    rng = np.random.default_rng([seed, *kind.encode()])
    for _ in range(TRIES):
        site = KINDS[kind](rng)
        world = site.world(f"{kind}_{split}_{index}")
        try:
            check_world(world, radius_m, site.spare_m, site.search_m)
        except WorldError:
            continue
        return world
    raise WorldError(f"world {index} of '{kind}': none of {TRIES} draws has a way through")


class WorldSource(Protocol):
    """Where the world of a flight comes from."""

    @property
    def fixed(self) -> bool:
        """So few worlds that each is flown many times?"""
        ...

    def draw(self, rng: np.random.Generator) -> World:
        """The world of the next flight."""
        ...


@dataclass(frozen=True)
class FewWorlds:
    """One of these, each as often as the others."""

    worlds: tuple[World, ...]

    @property
    def fixed(self) -> bool:
        """See ``WorldSource``."""
        return len(self.worlds) <= FEW

    def draw(self, rng: np.random.Generator) -> World:
        """Any of them."""
        return self.worlds[int(rng.integers(len(self.worlds)))]


@dataclass(frozen=True)
class RandomWorlds:
    """Worlds of one kind; the first ``count`` of the split, or all of it."""

    kind: str
    split: str = "train"
    count: int = SPLIT_SIZE
    radius_m: float = RADIUS_M
    fixed: bool = False

    def draw(self, rng: np.random.Generator) -> World:
        """Any of them."""
        return _remembered(self.kind, self.split, int(rng.integers(self.count)), self.radius_m)

    def worlds(self) -> Iterator[World]:
        """Each once, in order: for tables."""
        return (_remembered(self.kind, self.split, index, self.radius_m) for index in range(self.count))


@lru_cache(maxsize=512)
def _remembered(kind: str, split: str, index: int, radius_m: float) -> World:
    return random_world(kind, split, index, radius_m)


Worlds = str | World | WorldSource | Sequence[str | World]


def world_source(worlds: Worlds, radius_m: float = RADIUS_M) -> WorldSource:
    """What a configuration means by ``worlds``.

    A world, a name or file of one, ``KIND[:SPLIT[:COUNT]]`` (``barrier``, ``mixed:train:300``), or a sequence of worlds
    and names. Raises InputError.
    """
    if isinstance(worlds, World):
        return FewWorlds((worlds,))
    if isinstance(worlds, str):
        kind, *rest = worlds.split(":")
        return _random(worlds, kind, rest, radius_m) if kind in KINDS else FewWorlds((_named(worlds, radius_m),))
    if isinstance(worlds, Sequence):
        if not worlds:
            raise InputError("no world to fly in")
        return FewWorlds(tuple(world if isinstance(world, World) else _named(world, radius_m) for world in worlds))
    return worlds


def _random(text: str, kind: str, rest: list[str], radius_m: float) -> RandomWorlds:
    split = rest[0] if rest else SPLITS[0]
    count = rest[1] if len(rest) == 2 else str(SPLIT_SIZE)
    if split not in SPLITS or len(rest) > 2 or not count.isdecimal() or not 0 < int(count) <= SPLIT_SIZE:
        raise InputError(f"worlds '{text}': wants KIND[:SPLIT[:COUNT]], SPLIT of {', '.join(SPLITS)}, COUNT from 1")
    return RandomWorlds(kind, split, int(count), radius_m)


def _named(name: str, radius_m: float) -> World:
    try:
        return load_world(name, radius_m=radius_m)
    except WorldError as error:
        if name in list_worlds() or not str(error).startswith("unknown world"):
            raise
        raise WorldError(f"unknown world '{name}'{nearest(name, [*list_worlds(), *KINDS])}") from error


def _sparsely_wooded(site: Site, rng: np.random.Generator) -> Site:
    return parts.with_trees(site, rng, rng.uniform(*SPARSE_PER_M2), (0.3, 0.3))
