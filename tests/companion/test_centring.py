"""Paths in the middle of gaps: the nearest hit against a plain search, and gaps of centimetres."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.core import gridmap
from companion.core.gridmap import MapParams
from companion.core.types import F64
from companion.policy.centring import centred, distances, opened
from companion.policy.grid_path import clearances, nearest_cells

places = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(2)), elements=st.floats(-6.0, 6.0))
MAP = MapParams(cell_m=0.05, cells=80)


@settings(max_examples=80, deadline=None)
@given(places, places, st.floats(0.1, 3.0))
def test_distances_are_those_of_a_plain_search_within_reach(asked: F64, hits: F64, reach_m: float) -> None:
    plain = np.hypot(asked[:, :1] - hits[:, 0], asked[:, 1:] - hits[:, 1]).min(axis=1)
    found = distances(asked, hits, reach_m)
    inside = plain < reach_m - 1e-3
    assert found[inside] == pytest.approx(plain[inside], abs=1e-3)
    assert np.isinf(found[plain > reach_m]).all()


def test_without_hits_there_is_no_distance_and_a_path_is_only_smoothed() -> None:
    path, nothing = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]), np.empty((0, 2))
    assert np.isinf(distances(path, nothing, 1.0)).all()
    smooth = centred(path, nothing, 0.5, 0.006, 60)
    assert smooth[[0, -1]] == pytest.approx(path[[0, -1]])
    assert smooth[1] == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("beside_m", [-0.03, 0.0, 0.03])
def test_a_path_beside_the_middle_of_a_gap_is_pushed_into_it(beside_m: float) -> None:
    hits = np.array([[1.0, -0.37], [1.0, 0.37]])
    path = np.stack([np.linspace(0.0, 2.0, 41), np.full(41, beside_m)], axis=1)
    path[[0, -1], 1] = 0.0
    pushed = centred(path, hits, 0.33 + 0.15, 0.006, 40)
    assert np.hypot(*(pushed[:, None] - hits).T).min() > 0.36


def test_the_path_given_is_left_as_it_is() -> None:
    path = np.array([[0.0, 0.0], [0.5, 0.1], [1.0, 0.0]])
    before = path.copy()
    centred(path, np.array([[0.5, 0.2]]), 0.4, 0.01, 5)
    assert (path == before).all()


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-1.9, 1.9), st.floats(-1.9, 1.9)), min_size=1, max_size=15), st.floats(0.1, 0.5))
def test_opened_cells_are_those_that_just_missed_it_and_no_clearance_shrinks(
    hits: list[tuple[float, float]], hard_m: float
) -> None:
    grid = gridmap.empty(MAP)
    cells, _ = gridmap.cells_of(grid, np.array(hits))
    grid.hit_t.ravel()[cells] = 1.0
    grid.hit_ne_m.reshape(-1, 2)[cells] = hits
    nearest = nearest_cells(grid.hit_t > gridmap.NEVER)
    clearance = clearances(grid, nearest)
    result = opened(grid, clearance, nearest, hard_m)
    changed = result != clearance
    assert (result >= clearance).all()
    assert (clearance[changed] < hard_m).all()
    assert (clearance[changed] > hard_m - 0.5 * grid.cell_m).all()
    assert (result - clearance <= 0.36 * grid.cell_m + 1e-9).all()  # to a quarter's middle and no farther
