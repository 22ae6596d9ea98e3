"""How far apart are two flights? The distance of paths, and the row that says it."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mission.compare_firmware import apart_m

place = st.tuples(st.floats(-50, 50), st.floats(-50, 50))
path = st.lists(place, min_size=1, max_size=20).map(np.array)


@given(path)
def test_a_path_is_on_itself(one: np.ndarray) -> None:
    assert apart_m(one, one).max() < 1e-6


@given(path, path)
def test_the_order_of_the_flights_does_not_matter(one: np.ndarray, other: np.ndarray) -> None:
    assert apart_m(one, other).max() == apart_m(other, one).max()


def test_how_a_path_is_sampled_does_not_matter() -> None:
    ends = np.array([[0.0, 0.0], [10.0, 0.0]])
    fine = np.linspace(ends[0], ends[1], 101) + np.array([0.0, 0.4])
    assert apart_m(ends, fine).max() == 0.4


def test_a_detour_of_one_flight_alone_counts() -> None:
    line = np.array([[0.0, 0.0], [10.0, 0.0]])
    detour = np.array([[0.0, 0.0], [5.0, 3.0], [10.0, 0.0]])
    assert apart_m(line, detour).max() == apart_m(detour, line).max() == 3.0


def test_a_flight_that_never_was_is_no_comparison() -> None:
    assert math.isnan(apart_m(np.zeros((0, 2)), np.ones((3, 2))).max())
