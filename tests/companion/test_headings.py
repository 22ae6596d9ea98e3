"""What a ranking of headings proposes."""

import numpy as np
from policy_kit import query

from companion.policy.decoder import DecoderParams
from companion.policy.headings import LASTS_S, NEXT_CHOICES, NEXT_HEADINGS, headings_rad, ranked, steadied


def test_a_ranking_proposes_its_best_has_next_choices_and_says_how_long_a_path_lasts() -> None:
    proposal, best_rad = ranked(-0.1 * np.abs(np.arange(41.0) - 20.0), query(), DecoderParams())
    assert best_rad == 0.0
    assert len(proposal.others_ne_m) == NEXT_CHOICES
    assert proposal.lasts_s == LASTS_S


def test_a_heading_that_the_policy_thinks_little_of_is_no_next_choice() -> None:
    logits = np.full(41, -9.0)
    logits[[20, 21]] = 1.0, 0.0
    proposal, _ = ranked(logits, query(), DecoderParams())
    assert len(proposal.others_ne_m) == NEXT_CHOICES - NEXT_HEADINGS + 1


def test_turning_back_wants_to_be_surer_than_going_on() -> None:
    params = DecoderParams()
    ways = headings_rad(params)
    logits = np.zeros(41)
    logits[[5, 35]] = 3.0, 2.0
    assert steadied(logits, None, params).argmax() == 5
    assert steadied(logits, float(ways[35]), params).argmax() == 35
    logits[5] = 30.0
    assert steadied(logits, float(ways[35]), params).argmax() == 5
