"""Every claim of the paper is judged by its rule: on figures as the paper tells them, and on others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reproduce_kit import AS_TOLD, OTHERWISE, SWIFT

from mission.reproduce.arms import load_table
from mission.reproduce.claims import Claim, Verdict, agree, judge_all, told
from mission.reproduce.measures import Figures
from mission.reproduce.paper_claims import CLAIMS

NAMES = [claim.name for claim in CLAIMS]


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_a_claim_holds_on_figures_as_the_paper_tells_them(claim: Claim) -> None:
    outcomes = judge_all([claim], AS_TOLD)
    assert [outcome.verdict for outcome in outcomes] == [Verdict.HOLDS] * len(claim.settings), outcomes[0].measured


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_a_claim_does_not_hold_on_figures_that_say_otherwise(claim: Claim) -> None:
    outcomes = judge_all([claim], OTHERWISE)
    assert [outcome.verdict for outcome in outcomes] == [Verdict.FAILS] * len(claim.settings), outcomes[0].measured


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_a_claim_whose_arm_was_not_run_is_not_judged(claim: Claim) -> None:
    for settings, arms in claim.settings.items():
        for missing in arms:
            rest = {name: seeds for name, seeds in AS_TOLD.items() if name != missing}
            outcome = next(o for o in judge_all([claim], rest) if o.settings == settings)
            assert outcome.verdict is Verdict.NOT_MEASURED
            assert missing in outcome.measured


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_a_claim_is_not_judged_by_figures_that_are_missing(claim: Claim) -> None:
    nothing: Figures = dict.fromkeys(SWIFT)
    outcomes = judge_all([claim], {name: [nothing] for name in AS_TOLD})
    assert {outcome.verdict for outcome in outcomes} == {Verdict.NOT_MEASURED}


def test_one_seed_has_no_interval_to_lie_apart() -> None:
    alone = {name: seeds[:1] for name, seeds in AS_TOLD.items()}
    claim = next(claim for claim in CLAIMS if claim.name == "per_quicker")
    outcome = judge_all([claim], alone)[0]
    assert outcome.verdict is Verdict.NOT_MEASURED
    assert outcome.measured == "too little was flown to tell the interval of successes_first100 over seeds"
    assert outcome.seeds == "replay_per 1, replay_uniform 1"


def test_every_claim_has_a_place_a_rule_and_arms_of_the_table() -> None:
    table = load_table()
    assert len(set(NAMES)) == len(NAMES)
    for claim in CLAIMS:
        assert claim.place
        assert claim.text
        assert claim.rule
        for arms in claim.settings.values():
            assert [table.arm(name).name for name in arms] == list(arms)


@given(st.lists(st.booleans(), min_size=1, max_size=20))
def test_four_seeds_in_five_agree(says: list[bool]) -> None:
    assert agree([{"x": float(yes)} for yes in says], lambda seed: seed["x"] == 1.0) == (sum(says) >= 0.8 * len(says))


def test_a_figure_is_told_with_its_interval() -> None:
    assert told([{"x": 1.0}, {"x": 3.0}], "x") == "2.00 [-10.71, 14.71]"  # t(0.975, 1) = 12.706
    assert told([{"x": 1.5}], "x", 1) == "1.5"
    assert told([{"x": None}], "x") == "-"
