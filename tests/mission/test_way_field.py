"""Seconds that the rest of the way takes, by the true map: worked by hand in open air, round a wall, inside things."""

import math

import numpy as np
import pytest

from mission.training.way_field import way_field
from sitl.world import World

RADIUS_M = 0.33
BOUNDS_M = (-5.0, -20.0, 45.0, 20.0)


def world(*boxes: tuple[float, ...]) -> World:
    return World("test", np.zeros(2), np.array([40.0, 0.0]), BOUNDS_M, np.empty((0, 4)), np.array(boxes).reshape(-1, 6))


def test_in_open_air_it_is_the_distance_over_the_cruise_speed() -> None:
    field = way_field(world(), RADIUS_M, 2.0)
    assert field.at(20.0, 0.0) == pytest.approx(10.0, abs=0.2)
    assert field.at(40.0, 3.0) == pytest.approx(1.5, abs=0.2)


def test_behind_a_wall_it_is_the_way_round_its_nearer_end() -> None:
    field = way_field(world((20.0, 0.0, 0.0, 0.2, 8.0, 5.0)), RADIUS_M, 2.0)
    round_it_s = 2.0 * math.hypot(20.0, 8.0 + RADIUS_M + 0.8) / 2.0
    assert round_it_s - 1.0 < field.at(0.0, 0.0) < round_it_s + 1.0
    assert field.at(19.0, 6.0) < field.at(19.0, 0.0) > field.at(19.0, -6.0)


def test_where_the_vehicle_does_not_fit_there_still_is_a_way_out() -> None:
    field = way_field(world((20.0, 0.0, 0.0, 2.0, 2.0, 5.0)), RADIUS_M, 2.0)
    assert math.isfinite(field.at(20.0, 0.0)) and field.at(20.0, 0.0) > field.at(23.0, 0.0)
    assert math.isfinite(field.at(-100.0, 100.0))
