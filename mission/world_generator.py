"""Which random forest belongs to this seed? Poisson trunks with start and goal on the long axis; deterministic."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import resources

import numpy as np

from mission.world_check import RADIUS_M, WorldError, check_world
from mission.world_file import world_hash
from sitl.world import World

INSET_M = 3.0  # start and goal lie this far inside the short sides
AREA_MAX_M2 = 1e6
DENSITY_MAX_PER_M2 = 1.0


def generate_forest(
    seed: int,
    density_per_m2: float = 0.05,
    size_m: tuple[float, float] = (60.0, 40.0),
    trunk_diameter_m: float = 0.6,
    clear_m: float = 2.0,
    radius_m: float = RADIUS_M,
) -> World:
    """A forest of ``size_m`` (north, east) whose start is the origin and whose goal lies north of it.

    The number of trunks is Poisson, their places uniform; a trunk whose surface is nearer than ``clear_m`` to start or
    goal is left out. Raises WorldError where the arguments make no forest or no way leads through it.
    """
    length_m, width_m = size_m
    _check_arguments(seed, density_per_m2, size_m, trunk_diameter_m, clear_m)
    goal_m = length_m - 2.0 * INSET_M
    rng = np.random.default_rng(seed)
    count = int(rng.poisson(density_per_m2 * length_m * width_m))
    places = rng.uniform((-INSET_M, -width_m / 2), (length_m - INSET_M, width_m / 2), size=(count, 2))
    keep_m = clear_m + trunk_diameter_m / 2
    clear = (np.hypot(*places.T) >= keep_m) & (np.hypot(places[:, 0] - goal_m, places[:, 1]) >= keep_m)
    trunks = places[clear]
    world = World(
        name=f"forest_{seed}",
        start_ned_m=np.zeros(2),
        goal_ned_m=np.array([goal_m, 0.0]),
        bounds_m=(-INSET_M, -width_m / 2, length_m - INSET_M, width_m / 2),
        circles=np.column_stack([trunks, np.full(len(trunks), trunk_diameter_m / 2), np.full(len(trunks), np.inf)]),
        boxes=np.empty((0, 6)),
    )
    check_world(world, radius_m)
    return world


@dataclass(frozen=True, slots=True)
class ForestSet:
    """Frozen forests for acceptance: never used for tuning."""

    seeds: tuple[int, ...]
    skipped: tuple[int, ...]  # seeds whose forest has no way through
    sha256: str  # over the hashes of all worlds, in order

    def worlds(self) -> Iterator[World]:
        """Each forest, in the order of its seed."""
        return map(generate_forest, self.seeds)


def forest100() -> ForestSet:
    """The frozen hundred: 60 x 40 m, 0.05 trunks of 0.6 m a square metre."""
    text = (resources.files("mission") / "worlds" / "forest100.json").read_text(encoding="utf-8")
    data = json.loads(text)
    return ForestSet(tuple(data["seeds"]), tuple(data["skipped"]), data["sha256"])


def freeze_forests(first_seed: int, count: int) -> ForestSet:
    """The first ``count`` seeds from ``first_seed`` on that have a way through."""
    seeds: list[int] = []
    skipped: list[int] = []
    worlds: list[World] = []
    seed = first_seed
    while len(seeds) < count:
        try:
            worlds.append(generate_forest(seed))
            seeds.append(seed)
        except WorldError:
            skipped.append(seed)
        seed += 1
    return ForestSet(tuple(seeds), tuple(skipped), hash_of(worlds))


def hash_of(worlds: Iterable[World]) -> str:
    """One sha256 over several worlds, in order."""
    return hashlib.sha256("".join(world_hash(world) for world in worlds).encode()).hexdigest()


def _check_arguments(
    seed: int, density_per_m2: float, size_m: tuple[float, float], trunk_diameter_m: float, clear_m: float
) -> None:
    if seed < 0:
        raise WorldError(f"forest: seed {seed} is negative")
    if not 0.0 <= density_per_m2 <= DENSITY_MAX_PER_M2:
        raise WorldError(f"forest: density {density_per_m2} trunks/m2 is outside [0, {DENSITY_MAX_PER_M2:g}]")
    if not 0.0 < trunk_diameter_m <= 10.0:
        raise WorldError(f"forest: trunk diameter {trunk_diameter_m} m is outside (0, 10]")
    if not 0.0 <= clear_m <= 100.0:
        raise WorldError(f"forest: clear radius {clear_m} m is outside [0, 100]")
    length_m, width_m = size_m
    if not (length_m > 2.0 * INSET_M and width_m > 0.0 and length_m * width_m <= AREA_MAX_M2):
        raise WorldError(
            f"forest: size {length_m} x {width_m} m: wants more than {2 * INSET_M:g} m north, at most 1 km2"
        )
