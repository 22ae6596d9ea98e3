"""What a ranking of headings proposes."""

from dataclasses import replace

import numpy as np
import pytest
from policy_kit import query

from companion.core import geometry
from companion.core.types import F64
from companion.policy.band import fits
from companion.policy.decoder import DecoderParams, arc, joined
from companion.policy.headings import LASTS_S, NEXT_CHOICES, NEXT_HEADINGS, headings_rad, ranked, steadied
from companion.policy.interface import WAYPOINTS
from companion.policy.learned import PolicySpec, recalled
from companion.policy.observations import last_heading_rad, remember

SHORT_PATHS = DecoderParams(headings_m=1.5)
AHEAD = -0.1 * np.abs(np.arange(41.0) - 20.0)


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


def gap(width_m: float, east_m: float) -> F64:
    """A wall 0.6 m north with a gap."""
    side = np.arange(0.0, 2.0, 0.05)
    easts = np.concatenate([east_m - width_m / 2.0 - side, east_m + width_m / 2.0 + side])
    return np.stack([np.full(len(easts), 0.6), easts], axis=1)


@pytest.mark.parametrize("east_m", [-0.15, 0.0, 0.1])
def test_a_centred_path_leads_through_the_middle_of_a_gap_that_its_heading_just_misses(east_m: float) -> None:
    hits = gap(0.8, east_m)
    straight = [fits(joined(query(), arc(0.0, 0.0, 1.5, query(), SHORT_PATHS)), hits, query())]
    proposal, best_rad = ranked(AHEAD, query(), SHORT_PATHS, hits)
    way = np.concatenate([np.zeros((1, 2)), proposal.waypoints_ne_m])
    assert straight == [east_m == 0.0] and best_rad == 0.0
    assert len(proposal.waypoints_ne_m) <= WAYPOINTS
    assert geometry.nearest_distance(way, hits) > 0.33 + 0.05
    assert geometry.length(way) > 1.2


def test_there_are_no_next_headings_while_a_path_along_the_best_fits() -> None:
    own = NEXT_CHOICES - NEXT_HEADINGS
    assert len(ranked(AHEAD, query(), SHORT_PATHS, gap(0.8, 0.0))[0].others_ne_m) == own
    assert len(ranked(AHEAD, query(), SHORT_PATHS, gap(0.5, 0.0))[0].others_ne_m) == NEXT_CHOICES


def test_at_the_goal_a_centred_path_is_no_longer_than_what_is_left() -> None:
    for left_m in (0.0, 0.2):
        proposal, _ = ranked(AHEAD, query(pos_ne_m=(20.0 - left_m, 0.0)), SHORT_PATHS, gap(0.8, 0.0))
        assert np.allclose(proposal.waypoints_ne_m[-1], (20.0, 0.0))


def test_what_counts_as_decided_is_the_course_that_is_flown() -> None:
    asked = replace(query(), course_rad=2.5)
    memory = remember(query(), None, 0.4, 0.0)
    spec = PolicySpec("map", "centred")
    assert last_heading_rad(asked, recalled(asked, memory, spec)) == 2.5
    assert recalled(asked, memory, PolicySpec("map", "headings")) is memory
    assert recalled(query(), memory, spec) is memory and recalled(asked, None, spec) is None
