"""What a ranking of headings proposes."""

import numpy as np
from policy_kit import query

from companion.policy.decoder import DecoderParams
from companion.policy.headings import LASTS_S, NEXT_CHOICES, ranked


def test_a_ranking_proposes_its_best_has_next_choices_and_says_how_long_a_path_lasts() -> None:
    proposal, best_rad = ranked(-np.abs(np.arange(41.0) - 20.0), query(), DecoderParams())
    assert best_rad == 0.0
    assert len(proposal.others_ne_m) == NEXT_CHOICES
    assert proposal.lasts_s == LASTS_S
