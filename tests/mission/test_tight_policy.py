"""The policy for gaps of a few centimetres more than the vehicle: where it is flown, and that it arrives alone."""

import pytest

from companion.policy.store import POLICIES, read_policy
from mission.pilots.registry import pilot_names
from mission.training.dagger_config import clone_preset
from mission.training.evaluate import EvalSpec, fly_one
from mission.training.flights import plan_in


def test_cellular_worlds_are_flown_slowly_in_still_air_with_the_profile() -> None:
    plan = plan_in("cellular", 3)
    assert plan.world.name == "cellular_test_3"
    assert plan.task.cruise_m_s == 2.0 and plan.draws.wind_ned_m_s == (0.0, 0.0, 0.0)
    assert (plan.params.map.cell_m, plan.params.map.sense_m) == (0.05, 4.0)


def test_its_card_says_how_it_was_trained() -> None:
    card, actor = read_policy(POLICIES / "tight")
    preset = clone_preset("tight")
    assert "tight" in pilot_names()
    assert card.spec == preset.policy_spec() and actor.sizes()[1:-1] == preset.hidden
    assert {card.training["world"], card.training["profile"]} == {preset.world, preset.profile}
    assert card.spec.head == "centred"
    alone = card.evaluation["cellular"]["guard_off"]
    assert alone["success"] > 0.8 and alone["contact"] == 0.0


@pytest.mark.parametrize("seed", [100, 107])
def test_it_arrives_alone_in_worlds_never_trained(seed: int) -> None:
    flight = fly_one(EvalSpec("tight", "cellular"), seed)
    assert flight.success and flight.guarded == 0
