"""S_fuzzy, weights, density and the sensitivity schedule against the equations."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from companion.perception.perceive import PerceptionParams, sensitivity
from companion.perception.polar import BEARING_RAD, BEARINGS
from companion.perception.score import WEIGHTS, directional_weights, local_density, membership, safety_score

NEAR_M, FAR_M = 2.0, 10.0
ranges = arrays(np.float64, BEARINGS, elements=st.floats(0.0, 40.0) | st.just(math.inf) | st.just(math.nan))


@pytest.mark.parametrize(
    ("range_m", "value"), [(0.0, 0.0), (2.0, 0.0), (4.0, 0.25), (6.0, 0.5), (10.0, 1.0), (55.0, 1.0)]
)
def test_membership_is_the_linear_rule_of_the_paper(range_m: float, value: float) -> None:
    assert membership(np.array([range_m]), NEAR_M, FAR_M)[0] == pytest.approx(value)


def test_an_unknown_range_is_unsafe_and_a_free_one_is_safe() -> None:
    assert membership(np.array([math.nan, math.inf]), NEAR_M, FAR_M).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("bearing_deg", "weight"),
    [
        (0, 1.0),
        (30, 1.0),
        (35, 0.5),
        (145, 0.5),
        (150, 0.2),
        (180, 0.2),
        (210, 0.2),
        (215, 0.5),
        (325, 0.5),
        (330, 1.0),
    ],
)
def test_weights_have_the_edges_of_the_paper(bearing_deg: float, weight: float) -> None:
    assert directional_weights(np.radians([bearing_deg]))[0] == weight


def test_score_of_one_blocked_front_bearing_is_worked_by_hand() -> None:
    # 13 front bearings weigh 1.0, 46 sides 0.5, 13 rear 0.2: sum 38.6; the nose at 4 m has membership 0.25.
    range_m = np.full(BEARINGS, math.inf)
    range_m[0] = 4.0
    assert WEIGHTS.sum() == pytest.approx(38.6)
    assert safety_score(range_m, NEAR_M, FAR_M) == pytest.approx((38.6 - 0.75) / 38.6)


def test_nothing_known_scores_zero_and_nothing_near_scores_one() -> None:
    assert safety_score(np.full(BEARINGS, math.nan), NEAR_M, FAR_M) == 0.0
    assert safety_score(np.full(BEARINGS, math.inf), NEAR_M, FAR_M) == pytest.approx(1.0)


@given(ranges)
def test_a_mirrored_scan_has_the_mirrored_score(range_m: np.ndarray) -> None:
    mirrored = range_m[(-np.arange(BEARINGS)) % BEARINGS]
    assert safety_score(mirrored, NEAR_M, FAR_M) == pytest.approx(safety_score(range_m, NEAR_M, FAR_M))
    assert local_density(mirrored, 8.0) == local_density(range_m, 8.0)


@given(ranges, st.integers(0, BEARINGS - 1), st.floats(0.0, 5.0))
def test_an_obstacle_that_comes_nearer_never_raises_the_score(range_m: np.ndarray, index: int, step_m: float) -> None:
    nearer = range_m.copy()
    nearer[index] = max(0.0, np.nan_to_num(nearer[index], nan=0.0, posinf=40.0) - step_m)
    assert safety_score(nearer, NEAR_M, FAR_M) <= safety_score(range_m, NEAR_M, FAR_M) + 1e-12


def test_density_counts_what_is_blocked_or_unknown_within_the_radius() -> None:
    range_m = np.full(BEARINGS, math.inf)
    range_m[:9], range_m[9:18] = 3.0, math.nan
    assert local_density(range_m, 8.0) == pytest.approx(18 / 72)


def test_sensitivity_stays_inside_its_declared_bounds_and_falls_with_density() -> None:
    params = PerceptionParams()
    scales = [sensitivity(density, params) for density in np.linspace(0.0, 1.0, 50)]
    assert max(scales) == 1.0
    assert min(scales) == pytest.approx(params.scale_min)
    assert all(a >= b for a, b in itertools.pairwise(scales))


def test_bearings_are_five_degrees_apart_from_the_nose_on() -> None:
    assert np.degrees(BEARING_RAD[1]) == pytest.approx(5.0)
    assert BEARING_RAD[0] == 0.0
