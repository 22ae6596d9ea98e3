"""Are random worlds as declared, the same for the same seed, flyable, and never those of another split?"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mission.bench.barn import FINE_M
from mission.bench.cells import SPARE_M, generate, held_out
from mission.errors import InputError
from mission.shortest_path import shortest_path_m
from mission.training.path_ratio import shortest_from
from mission.training.training_worlds import (
    DENSITY_PER_M2,
    KINDS,
    SPLIT_SIZE,
    SPLITS,
    TIGHT_KINDS,
    FewWorlds,
    RandomWorlds,
    random_world,
    world_source,
)
from mission.world_check import RADIUS_M, check_world, clearance_m
from mission.world_file import load_world, world_hash
from mission.world_generator import forest100, generate_forest
from sitl.world import World

ON_THE_LINE = ("deep", "t2like", "pocket")


def barred_share(world: World) -> float:
    """How much of the straight way to the goal is inside something, vehicle's radius included."""
    line = world.start_ned_m + np.linspace(0.0, 1.0, 500)[:, None] * (world.goal_ned_m - world.start_ned_m)
    return float(np.mean(clearance_m(world, line) < 0.33))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=4, deadline=None)
@given(index=st.integers(0, SPLIT_SIZE - 1), split=st.sampled_from(SPLITS))
def test_a_world_belongs_to_kind_split_and_index_and_can_be_flown(kind: str, index: int, split: str) -> None:
    world = random_world(kind, split, index)
    check_world(world, RADIUS_M, *((SPARE_M, FINE_M) if kind in TIGHT_KINDS else ()))
    assert world_hash(world) == world_hash(random_world(kind, split, index))
    ends = np.array([world.start_ned_m, world.goal_ned_m])
    assert (clearance_m(world, ends) >= 0.38).all()
    assert math.dist(*ends.tolist()) >= (10.0 if kind in TIGHT_KINDS else 50.0)


@pytest.mark.parametrize("kind", KINDS)
def test_splits_and_indices_share_no_world(kind: str) -> None:
    hashes = [world_hash(random_world(kind, split, index)) for split in SPLITS for index in range(3)]
    assert len(set(hashes)) == len(hashes)


def test_no_training_forest_is_one_of_the_frozen_hundred() -> None:
    seeds = forest100().seeds[:10]
    frozen = {world_hash(generate_forest(seed)) for seed in seeds}
    assert frozen.isdisjoint(world_hash(random_world("forest", "train", seed)) for seed in seeds)


def test_a_cellular_world_has_barns_measures_and_is_none_of_those_held_out() -> None:
    world = random_world("cellular", "train", 0)
    assert world.goal_ned_m.tolist() == [10.0, 0.0] and world.inside(*world.goal_ned_m)
    places = {tuple(place) for place in np.round(world.circles[:, :2], 3).tolist()}
    for seed in held_out().seeds[:5]:
        other = generate(seed)
        assert places != {tuple(place) for place in np.round(other.circles[:, :2] - other.start_ned_m, 3).tolist()}
    assert barred_share(world) > 0.0 or barred_share(random_world("cellular", "train", 1)) > 0.0


def test_forests_cover_their_range_of_densities() -> None:
    area_m2 = 60.0 * 40.0
    densities = [len(random_world("forest", "train", index).circles) / area_m2 for index in range(40)]
    assert DENSITY_PER_M2[0] * 0.7 < min(densities) < 0.07
    assert 0.11 < max(densities) < DENSITY_PER_M2[1] * 1.2


@pytest.mark.parametrize("kind", ON_THE_LINE)
@pytest.mark.parametrize("index", range(5))
def test_what_stands_on_the_line_bars_it(kind: str, index: int) -> None:
    assert barred_share(random_world(kind, "validation", index)) > 0.0


@pytest.mark.parametrize("index", range(3))
def test_a_deep_arc_makes_the_way_longer(index: int) -> None:
    world = random_world("deep", "test", index)
    assert shortest_path_m(world, world.start_ned_m, world.goal_ned_m, 0.33) > 55.0


def test_a_source_is_named_counted_or_given() -> None:
    rng = np.random.default_rng(0)
    assert world_source("trajectory1").draw(rng).name == "trajectory1"
    source = world_source("mixed:validation:3")
    assert isinstance(source, RandomWorlds)
    assert {source.draw(rng).name for _ in range(30)} == {f"mixed_validation_{k}" for k in range(3)}
    assert [world.name for world in source.worlds()] == [f"mixed_validation_{k}" for k in range(3)]
    both = world_source(["trajectory1", random_world("deep", "test", 1)])
    assert isinstance(both, FewWorlds)
    assert {both.draw(rng).name for _ in range(20)} == {"trajectory1", "deep_test_1"}
    assert world_source(both) is both


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("barier", "did you mean 'barrier'"),
        ("barrier:tests", "SPLIT of train, validation, test"),
        ("barrier:test:0", "COUNT from 1"),
        ("barrier:test:1:2", "KIND"),
        ([], "no world"),
    ],
)
def test_a_source_that_is_none_is_refused_with_the_reason(named: str | list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        world_source(named)


def test_an_index_outside_its_split_is_refused() -> None:
    with pytest.raises(InputError, match="outside"):
        random_world("deep", "train", SPLIT_SIZE)


def test_from_beside_the_start_the_shortest_way_is_as_long_as_worked_out_anew() -> None:
    world = load_world("trajectory2")
    rng = np.random.default_rng(3)
    for offset in rng.uniform(-1.4, 1.4, size=(2, 2)):
        exact_m = shortest_path_m(world, world.start_ned_m + offset, world.goal_ned_m, 0.33)
        assert shortest_from(world, world.start_ned_m + offset, 0.33) == pytest.approx(exact_m, rel=0.01)


def test_where_no_way_leads_the_shortest_is_infinite() -> None:
    walled = replace(load_world("open"), boxes=np.array([[25.0, 0.0, math.pi / 2, 500.0, 0.2, math.inf]]))
    walled = replace(walled, start_ned_m=np.zeros(2), goal_ned_m=np.array([50.0, 0.0]), bounds_m=(-5, -20, 55, 20))
    assert shortest_from(walled, np.array([0.5, 0.5]), 0.33) == math.inf
