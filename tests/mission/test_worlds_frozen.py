"""Are the acceptance worlds the ones that were frozen, and what the paper says of them?"""

import json
from dataclasses import replace
from importlib import resources

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest

from mission.figures_world import draw_world
from mission.world_check import clearance_m, widest_way_m
from mission.world_file import list_worlds, load_world, world_hash
from mission.world_generator import WorldError, forest100, generate_forest, hash_of
from sitl.world import World

FOLDER = resources.files("mission") / "worlds"
PAPER_WORLDS = ("trajectory1", "trajectory1_movers", "trajectory2")
ROWS_NORTH_M = ((17.0, 25.0), (30.0, 36.0), (42.0, 47.0))  # barrier, second and third row of trajectory2


def frozen() -> dict[str, str]:
    lines = (FOLDER / "FROZEN.sha256").read_text(encoding="utf-8").splitlines()
    return {name: digest for digest, name in (line.split() for line in lines)}


@pytest.mark.parametrize("name", PAPER_WORLDS)
def test_a_paper_world_is_the_frozen_one(name: str) -> None:
    assert world_hash(load_world(name)) == frozen()[name]


def test_the_hundred_forests_are_the_frozen_ones() -> None:
    forests = forest100()
    assert len(forests.seeds) == 100
    assert hash_of(forests.worlds()) == forests.sha256


def test_a_forest_belongs_to_its_seed() -> None:
    assert world_hash(generate_forest(7)) == world_hash(generate_forest(7))
    assert world_hash(generate_forest(7)) != world_hash(generate_forest(8))


@pytest.mark.parametrize("seed", range(5))
def test_a_forest_has_its_density_and_leaves_start_and_goal_clear(seed: int) -> None:
    world = generate_forest(seed, density_per_m2=0.04, size_m=(80.0, 50.0), trunk_diameter_m=0.5)
    assert len(world.circles) == pytest.approx(0.04 * 80 * 50, abs=4 * (0.04 * 80 * 50) ** 0.5)
    assert (clearance_m(world, np.array([world.start_ned_m, world.goal_ned_m])) >= 2.0).all()
    assert world.goal_ned_m.tolist() == [74.0, 0.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"density_per_m2": float("nan")}, "density nan"),
        ({"density_per_m2": -0.1}, "density -0.1"),
        ({"size_m": (5.0, 40.0)}, "size 5.0 x 40.0"),
        ({"trunk_diameter_m": 0.0}, "trunk diameter 0.0"),
        ({"density_per_m2": 0.9}, "not reachable"),
    ],
)
def test_a_forest_that_cannot_be_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(WorldError, match=message):
        generate_forest(1, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", PAPER_WORLDS)
def test_start_and_goal_are_50_m_apart_with_3_m_free_round_them(name: str) -> None:
    world = load_world(name)
    assert np.hypot(*(world.goal_ned_m - world.start_ned_m)) >= 50.0
    assert (clearance_m(world, np.array([world.start_ned_m, world.goal_ned_m])) >= 3.0).all()


def test_trajectory1_keeps_4_m_between_any_two_obstacles() -> None:
    assert nearest_neighbours_m(load_world("trajectory1")) >= 4.0


def test_trajectory1_has_a_wide_way_with_few_obstacles_on_the_line() -> None:
    world = load_world("trajectory1")
    assert widest_way_m(world, 3.0) >= 2.0
    line = np.column_stack([np.linspace(0.0, 54.0, 1000), np.zeros(1000)])
    near_line = np.abs(world.circles[:, 1]) - world.circles[:, 2] < 0.38
    assert 1 <= near_line.sum() <= 3
    assert (clearance_m(world, line) < 0.38).mean() < 0.1


def test_the_movers_cross_the_line_of_trajectory1_at_1_5_m_per_s_at_most() -> None:
    world, still = load_world("trajectory1_movers"), load_world("trajectory1")
    assert np.array_equal(world.circles, still.circles)
    assert np.array_equal(world.boxes, still.boxes)
    assert len(world.movers) == 3
    for mover in world.movers:
        assert mover.a_ned_m[1] * mover.b_ned_m[1] < 0.0
        assert 0.3 <= mover.radius_m <= 0.4
        assert mover.speed_m_s <= mover.speed_max_m_s <= 1.5
        way = np.linspace(mover.a_ned_m, mover.b_ned_m, 200)
        assert (clearance_m(still, way) > mover.radius_m).all()


@pytest.mark.parametrize("rows_north_m", ROWS_NORTH_M)
def test_every_row_of_trajectory2_is_passed_by_gaps_of_1_2_to_1_8_m_only(rows_north_m: tuple[float, float]) -> None:
    world = load_world("trajectory2")
    row = only(world, rows_north_m)
    assert 0.6 <= widest_way_m(row, 3.0) <= 0.9


def test_trajectory2_hides_the_goal_behind_a_concave_barrier() -> None:
    world = load_world("trajectory2")
    line = np.column_stack([np.linspace(0.0, 56.0, 1000), np.zeros(1000)])
    first_north = line[clearance_m(world, line) < 0.0][0, 0]
    assert first_north == pytest.approx(23.85, abs=0.1)
    beside = np.column_stack([np.full(2, 19.6), [6.5, -6.5]])
    assert (clearance_m(world, beside) < 0.0).all()  # its arms reach 4 m back towards the start


@pytest.mark.parametrize("name", list_worlds())
def test_a_world_can_be_drawn_with_its_axes_labelled(name: str) -> None:
    figure, ax = plt.subplots()
    draw_world(ax, load_world(name), t_s=3.0)
    figure.canvas.draw()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("east [m]", "north [m]")
    plt.close(figure)


def test_the_forest_file_says_what_was_skipped() -> None:
    data = json.loads((FOLDER / "forest100.json").read_text(encoding="utf-8"))
    assert sorted(data["seeds"] + data["skipped"]) == list(range(1000, 1100 + len(data["skipped"])))


def only(world: World, rows_north_m: tuple[float, float]) -> World:
    """The fence, and what stands between two norths."""
    low, high = rows_north_m
    fence = (np.abs(world.boxes[:, 1]) > 11.9) | (world.boxes[:, 0] > 60.0) | (world.boxes[:, 0] < -3.0)
    circles = world.circles[(world.circles[:, 0] > low) & (world.circles[:, 0] < high)]
    boxes = world.boxes[fence | ((world.boxes[:, 0] > low) & (world.boxes[:, 0] < high))]
    return replace(world, circles=circles, boxes=boxes)


def nearest_neighbours_m(world: World) -> float:
    """The smallest distance between the surface of one obstacle and a sample on another."""
    nearest = np.inf
    turns = np.linspace(0.0, 2 * np.pi, 64)
    for i, (north, east, radius, _) in enumerate(world.circles):
        rest = replace(world, circles=np.delete(world.circles, i, axis=0))
        rim = np.column_stack([north + radius * np.cos(turns), east + radius * np.sin(turns)])
        nearest = min(nearest, clearance_m(rest, rim).min())
    for i, (north, east, yaw, half_length, _, _) in enumerate(world.boxes):
        rest = replace(world, boxes=np.delete(world.boxes, i, axis=0))
        along = np.linspace(-half_length, half_length, 32)[:, None] * [[np.cos(yaw), np.sin(yaw)]]
        nearest = min(nearest, clearance_m(rest, np.array([north, east]) + along).min())
    return float(nearest)
