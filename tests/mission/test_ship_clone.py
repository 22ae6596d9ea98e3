"""A clone that ships: its card, and that no flight is flown twice."""

from dataclasses import replace
from pathlib import Path

import pytest

from companion.policy.store import Card, read_policy, save_policy
from mission.errors import InputError
from mission.training import ship_clone as module
from mission.training.dagger_config import DaggerConfig, write_config
from mission.training.evaluate import EvalSpec
from mission.training.networks import actor_net, as_numpy
from mission.training.scores import FlightFigures
from mission.training.ship_clone import CloneShipment, ship_clone

CONFIG = DaggerConfig(rounds=1, hidden=(8,))


def flight(spec: EvalSpec, seed: int) -> FlightFigures:
    won = spec.guard or spec.policy == "geometric"
    return FlightFigures(
        seed, spec.world, won, "landed" if won else "lost", False, not won, 30.0, 60.0, 50.0, 0.4, 1.0, 2, 30, 9.0,
        {"kept": 3}, 1, (1.0,),
    )  # fmt: skip


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_config(CONFIG, tmp_path / "run")
    spec = CONFIG.policy_spec()
    save_policy(tmp_path / "run" / "round-0", as_numpy(actor_net(50, 41, (8,), 1)), Card("forest", spec, {"seed": 1}))
    return tmp_path / "run"


def test_a_card_tells_every_world_guard_off_and_on_beside_the_expert(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[tuple[EvalSpec, int]] = []
    monkeypatch.setattr(module, "fly_one", lambda spec, seed: flown.append((spec, seed)) or flight(spec, seed))
    shipment = CloneShipment(run, "forest", ("barrier", "pocket"), 2, 1, 7, tmp_path / "policies")
    first = ship_clone(shipment, lambda count, planned: None)
    assert len(flown) == 8
    assert {seed for _, seed in flown} == {7, 8}
    assert ship_clone(shipment, lambda count, planned: None) == first
    assert len(flown) == 8
    card, _ = read_policy(tmp_path / "policies" / "forest")
    assert card.evaluation["pocket"]["guard_on"]["success"] == 1.0
    assert card.evaluation["pocket"]["guard_off"]["success"] == 0.0
    assert "3 m/s" in card.limits[0]


def test_a_card_names_the_profile_that_was_trained_with(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    card, actor = read_policy(run / "round-0")
    save_policy(
        run / "round-0", actor, replace(card, training={"profile": "tight", "cruise_m_s": 2.0, "wind_m_s": [0.0, 1.0]})
    )
    monkeypatch.setattr(module, "fly_one", flight)
    ship_clone(CloneShipment(run, "tight", ("cellular",), 1, 1, 7, tmp_path / "out"), lambda *_: None)
    card, _ = read_policy(tmp_path / "out" / "tight")
    assert "'tight' at 2 m/s" in card.limits[0]


def test_a_seed_that_was_trained_ships_alike(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = CONFIG.policy_spec()
    save_policy(tmp_path / "seed_2" / "policy", as_numpy(actor_net(50, 41, (8,), 1)), Card("x", spec, {"seed": 2}))
    monkeypatch.setattr(module, "fly_one", flight)
    ship_clone(CloneShipment(tmp_path / "seed_2", "forest", ("deep",), 1, 1, 7, tmp_path / "out"), lambda *_: None)
    card, _ = read_policy(tmp_path / "out" / "forest")
    assert card.training["seed"] == 2


def test_a_run_that_is_not_over_does_not_ship(tmp_path: Path) -> None:
    write_config(CONFIG, tmp_path / "begun")
    with pytest.raises(InputError, match="--resume"):
        ship_clone(CloneShipment(tmp_path / "begun", "forest"), lambda count, planned: None)
