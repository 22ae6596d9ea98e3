import math
from importlib import resources

import numpy as np
import pytest
import yaml

from mission.bench import cells, published_sets
from mission.bench.suites import (
    FOREST_M_S,
    FOREST_PER_M2,
    GAP_M_S,
    POLE_M_S,
    YARDS,
    spread,
    suite_named,
    suite_names,
)
from mission.cli_bench_suites import SUITES
from mission.errors import InputError
from mission.world_check import clearance_m
from mission.world_generator import hash_of


def test_the_commands_know_every_suite():
    assert sorted([*SUITES, "barn"]) == sorted(suite_names())


def test_an_unknown_suite_is_named_with_the_nearest():
    with pytest.raises(InputError, match="did you mean 'forest'"):
        suite_named("forrest")


def test_barn_wants_a_folder():
    with pytest.raises(InputError, match="wants a folder"):
        suite_named("barn")


def test_a_part_of_a_suites_cells_is_flown_by_their_names():
    forest = suite_named("forest")
    assert [cell.name for cell in forest.only("at 10 m/s").cells] == [f"{name} at 10 m/s" for name in FOREST_PER_M2]
    assert forest.only("") == forest
    with pytest.raises(InputError, match="--cell '9 m/s': suite 'pole' has '3 m/s'"):
        suite_named("pole").only("9 m/s")


def test_suites_have_the_cells_of_the_set_ups():
    assert len(suite_named("forest").cells) == len(FOREST_PER_M2) * len(FOREST_M_S) == 15
    assert [cell.name for cell in suite_named("pole").cells] == [f"{v:g} m/s" for v in POLE_M_S]
    assert [cell.name for cell in suite_named("gap").cells] == [f"{v:g} m/s" for v in GAP_M_S]
    assert [cell.name for cell in suite_named("dynamic").cells] == list(YARDS)


@pytest.mark.parametrize(("name", "density"), FOREST_PER_M2.items())
def test_forests_have_their_density_trunks_and_clear_start(name, density):
    forests = [published_sets.forest(seed, density) for seed in range(12)]
    area_m2 = math.prod(published_sets.FOREST_M)
    mean = np.mean([len(world.circles) for world in forests])
    assert mean == pytest.approx(density * area_m2, rel=0.15), name
    for world in forests:
        assert np.unique(world.circles[:, 2]).tolist() == [published_sets.TRUNK_M]
        assert clearance_m(world, world.start_ned_m[None])[0] >= published_sets.CLEAR_M


def test_every_run_of_a_cell_flies_the_same_world_whoever_flies_it():
    for name in ("forest", "gap", "pole", "dynamic"):
        cell = suite_named(name).cells[0]
        again = suite_named(name).cells[0]
        assert np.array_equal(cell.course(3).world.circles, again.course(3).world.circles)
        assert np.array_equal(cell.course(3).world.boxes, again.course(3).world.boxes)
        assert cell.course(3).world.movers == again.course(3).world.movers


def test_loquercios_vehicle_is_a_sphere_that_sees_six_metres_at_most_at_fifteen_hertz():
    for name in ("forest", "gap", "pole"):
        rules = suite_named(name).cells[0].course(0).rules
        assert (rules.radius_m, rules.range_m) == (0.2, 6.0)
        assert 14.5 < rules.rate_hz <= 15.0


def test_a_gap_is_as_wide_and_as_far_off_as_it_says():
    for seed in range(20):
        left, right = published_sets.gap(seed).boxes.tolist()
        opening_m = (right[1] - right[3]) - (left[1] + left[3])
        middle_m = (right[1] - right[3] + left[1] + left[3]) / 2
        assert 0.8 <= opening_m <= 1.0
        assert abs(middle_m) <= 5.0
        assert left[0] == right[0] == 10.0
        assert 2 * (left[3] + right[3]) + opening_m == pytest.approx(40.0)


def test_among_what_moves_the_companion_flies_as_profile_crowd_says():
    crowd = (resources.files("companion") / "profiles" / "crowd.yaml").read_text(encoding="utf-8")
    assert suite_named("dynamic").cells[0].course(0).rules.params == yaml.safe_load(crowd)


def test_the_pole_stands_six_metres_ahead_of_a_start_at_speed():
    course = suite_named("pole").cells[2].course(0)
    assert course.world.circles[0, :3].tolist() == [6.0, 0.0, 0.75]
    assert course.rules.at_speed and course.rules.speed_m_s == 7.0


@pytest.mark.parametrize(("name", "counts"), YARDS.items())
def test_yards_have_their_counts_and_movers_stay_inside_and_in_their_speeds(name, counts):
    world = published_sets.yard(1, *counts)
    assert (len(world.circles), len(world.movers)) == counts, name
    for mover in world.movers:
        assert 0.5 <= mover.speed_m_s <= 1.5
        places = np.array([mover.position_ned_m(t) for t in np.linspace(0.0, 40.0, 50)])
        assert (places[:, 0] >= 0.0).all() and (places[:, 0] <= 20.0).all() and (abs(places[:, 1]) <= 10.0).all()


def test_a_flight_to_a_line_ends_beyond_it_and_a_flight_to_a_goal_near_it():
    pole, yard = suite_named("pole").cells[0].course(0), suite_named("dynamic").cells[0].course(0)
    assert not pole.finished(11.9, 0.0) and pole.finished(12.0, 3.0)
    assert not yard.finished(20.9, 0.0) and yard.finished(22.0, 0.9)
    assert pole.sent_to_ned_m[0] > 12.0 + 30.0  # no pilot brakes for the line
    assert yard.sent_to_ned_m.tolist() == yard.world.goal_ned_m.tolist()


def test_the_held_out_worlds_are_the_frozen_ones():
    frozen = cells.held_out()
    assert len(frozen.seeds) == cells.COUNT
    assert hash_of(frozen.worlds()) == frozen.sha256


def test_a_world_of_the_automaton_is_walled_and_has_barns_scale():
    world = cells.generate(cells.held_out().seeds[0])
    field = world.circles[world.circles[:, 0] >= cells.SOUTH_M - 0.01]
    assert field[:, 0].max() == pytest.approx(9.425)
    for edge in (-4.425, -0.075):
        assert (np.abs(field[:, 1] - edge) < 1e-9).sum() == cells.SIDE
    assert np.unique(world.circles[:, 2]).tolist() == [cells.CYLINDER_M]


def test_the_automaton_fills_where_five_neighbours_are_filled_and_empties_what_stands_alone():
    filled = np.zeros((cells.SIDE, cells.SIDE), dtype=bool)
    filled[10, 10] = True  # alone
    filled[20:23, 20:23] = True
    filled[21, 21] = False  # eight neighbours
    after = cells.smoothed(filled)
    assert not after[10, 10]
    assert after[21, 21]


def test_the_first_few_of_many_worlds_are_spread_over_all_of_them():
    numbers = tuple(range(200))
    first = sorted(spread(numbers)[:20])
    assert sorted(spread(numbers)) == list(numbers)
    assert max(np.diff([0, *first, 199])) <= 20
