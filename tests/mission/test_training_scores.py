"""Figures of several flights, and of policies flown."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.errors import InputError
from mission.rates import wilson
from mission.training.baselines import RandomPolicy, check_policy
from mission.training.evaluate import EvalSpec, fly_many, fly_one
from mission.training.flights import plan_in
from mission.training.scores import FlightFigures, summary

WON = FlightFigures(
    seed=1,
    world="w",
    success=True,
    reason="landed",
    contact=False,
    timeout=False,
    time_s=30.0,
    path_m=60.0,
    shortest_m=50.0,
    min_clearance_m=0.4,
    jerk_m2_s6=2.0,
    switches=3,
    switches_bound=31,
    rl_time_s=15.0,
    verdicts={"kept": 3, "modified": 1},
    guarded=2,
    tick_ms=(1.0, 2.0, 3.0),
)
LOST = dataclasses.replace(
    WON, seed=2, success=False, reason="time", timeout=True, time_s=90.0, min_clearance_m=0.2, verdicts={"refused": 4}
)


def test_the_figures_of_two_flights_worked_out_by_hand() -> None:
    figures = summary([WON, LOST])
    assert (figures["success"], figures["contact"], figures["timeout"]) == (0.5, 0.0, 0.5)
    assert figures["spl"] == pytest.approx(0.5 * 50.0 / 60.0)
    assert figures["path_ratio"] == pytest.approx(1.2)
    assert figures["time_s"] == 30.0
    assert figures["min_clearance_m"] == 0.2
    assert figures["switches_per_min"] == pytest.approx(3.0)
    assert figures["switches_bound_per_min"] == pytest.approx(31.0)
    assert (figures["kept"], figures["modified"], figures["refused"]) == (0.375, 0.125, 0.5)
    assert figures["guarded"] == 0.5
    assert figures["rl_share"] == pytest.approx(0.25)
    assert figures["decision_p50_ms"] == 2.0
    assert figures["failures"] == [{"seed": 2, "world": "w", "reason": "time"}]


def test_an_interval_after_wilson() -> None:
    assert wilson(8, 10) == pytest.approx(
        (0.4902, 0.9433), abs=1e-4
    )  # Wilson 1927, as R's prop.test without correction
    assert wilson(0, 20)[0] == 0.0
    assert wilson(20, 20)[1] == 1.0
    assert wilson(0, 0) == (0.0, 1.0)


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_an_interval_holds_its_rate_and_mirrors(trials: tuple[int, int]) -> None:
    hits, count = trials
    low, high = wilson(hits, count)
    assert 0.0 <= low <= hits / count <= high <= 1.0
    assert wilson(count - hits, count) == pytest.approx((1.0 - high, 1.0 - low))


def test_a_flight_of_the_expert_is_that_of_the_tables() -> None:
    from mission.tables import fly_row

    flight, row = fly_one(EvalSpec("geometric", "trajectory1"), 3), fly_row("trajectory1", 3, "geometric")
    assert (flight.success, flight.time_s, flight.path_m) == (row.success, row.time_s, row.path_m)
    assert (flight.switches, flight.switches_bound) == (row.switches, row.switches_bound)
    assert flight.path_ratio == pytest.approx(row.path_ratio)
    assert flight.min_clearance_m == pytest.approx(row.min_clearance_m)


def test_straight_flies_where_little_stands_and_random_is_the_same_again() -> None:
    assert next(iter(fly_many(EvalSpec("straight", "trajectory1"), [0]))).success
    plans = [plan_in("barrier", 2) for _ in range(2)]
    assert plans[0].world.name == plans[1].world.name == "barrier_test_2"
    assert RandomPolicy(1) == RandomPolicy(1)


@pytest.mark.parametrize("world", ["trajectory2", "barrier", "forest:validation"])
def test_flights_in_a_world_are_a_function_of_the_seed(world: str) -> None:
    one, same, other = plan_in(world, 7), plan_in(world, 7), plan_in(world, 8)
    assert one.draws == same.draws
    assert np.array_equal(one.world.circles, same.world.circles)
    assert one.draws != other.draws


def test_what_cannot_be_flown_is_told_with_the_nearest_name() -> None:
    with pytest.raises(InputError, match=r"unknown world 'barier'; did you mean 'barrier'\?"):
        plan_in("barier", 0)
    with pytest.raises(InputError, match=r"unknown policy 'geometrc'; did you mean 'geometric'\?"):
        check_policy("geometrc")
    with pytest.raises(InputError, match="does not exist"):
        check_policy("./nowhere")
