"""A trained seed becomes a policy with a name and an honest card."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.policy.actor import Actor
from companion.policy.learned import PolicySpec
from companion.policy.store import Card, read_policy, save_policy
from mission.errors import InputError
from mission.training import ship as shipping
from mission.training.flights import plan_in
from mission.training.presets import load_preset
from mission.training.run_folder import RunSpec, make_run
from mission.training.scores import FlightFigures
from mission.training.ship import Shipment, figures_of, judged_in, ship
from mission.training.until import Until

FLOWN = FlightFigures(
    seed=1, world="trajectory1", success=True, reason="landed", contact=False, timeout=False, time_s=20.0,
    path_m=55.0, shortest_m=50.0, min_clearance_m=0.4, jerk_m2_s6=1.0, switches=2, switches_bound=20, rl_time_s=5.0,
    verdicts={"kept": 4}, guarded=0, tick_ms=(2.0,),
)  # fmt: skip
LATE = replace(FLOWN, success=False, reason="took 50.0 s, allowed are 38.0 s", time_s=50.0)
HIT = replace(FLOWN, success=False, reason="contact with an obstacle at 3.00 s", contact=True)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of seeds 1 and 2, of which the first has ended."""
    spec = RunSpec("trajectory1", load_preset("default"), (1, 2), Until())
    folder = make_run(spec, tmp_path / "run")
    sizes = [72, 4, 10]
    actor = Actor(
        tuple(np.zeros((n, m), np.float32) for m, n in itertools.pairwise(sizes)),
        tuple(np.zeros(n, np.float32) for n in sizes[1:]),
    )
    save_policy(folder / "seed_1" / "policy", actor, Card("t1_seed1", PolicySpec("goal"), {"seed": 1}))
    rows = [{"success": n > 0, "contact": False} for n in range(4)]
    (folder / "seed_1" / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder


def test_a_shipped_policy_carries_its_figures_with_guard_off_and_on(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shipping, "fly_many", lambda spec, seeds, jobs: [FLOWN for _ in seeds])
    told: list[tuple[str, int]] = []
    ship(Shipment(run, 1, "trajectory1", 30, into=tmp_path), lambda name, count: told.append((name, count)))
    card, _ = read_policy(tmp_path / "trajectory1")
    assert card.name == "trajectory1"
    assert card.training["seeds"]["1"] == {"episodes": 4, "successes": 3, "last_50": 0.75, "contacts": 0}
    assert told == [("guard_off", 30), ("guard_on", 30), ("straight", 10), ("random", 10)]
    assert card.evaluation["guard_off"]["success"] == 1.0
    assert not {"decision_p50_ms", "decision_p99_ms"} & set(card.evaluation["guard_on"])


def test_a_policy_of_random_worlds_is_judged_in_worlds_that_no_training_saw() -> None:
    assert plan_in(judged_in("barrier:train:300"), 0).world.name == "barrier_test_0"
    assert judged_in("trajectory1") == "trajectory1"


def test_a_flight_that_lands_late_has_arrived_but_is_no_success() -> None:
    figures = figures_of([FLOWN, LATE, HIT])
    assert figures["success"] == pytest.approx(1 / 3)
    assert figures["arrived"] == pytest.approx(2 / 3)
    assert figures["arrived_time_s"] == 35.0
    assert figures["reasons"] == {"took": 1, "contact": 1}


def test_what_falls_short_is_named_among_the_limits() -> None:
    assert shipping.limits_of({"guard_off": figures_of([FLOWN])}) == ()
    late, touched = shipping.limits_of({"guard_off": figures_of([FLOWN, LATE, HIT])})
    assert "33% of 3 flights are in time" in late and "66.7% land at the goal" in late
    assert "33.3% of the flights touch something" in touched


def test_a_seed_that_is_not_there_or_has_not_ended_is_told(run: Path) -> None:
    with pytest.raises(InputError, match="has no seed 7: it has 1, 2"):
        ship(Shipment(run, 7, "x"), lambda name, count: None)
    with pytest.raises(InputError, match="--resume"):
        ship(Shipment(run, 2, "x"), lambda name, count: None)
