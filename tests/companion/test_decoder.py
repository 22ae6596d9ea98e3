"""What an action means: both decoders worked by hand, the inverse, the mirror, the goal."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_kit import EAST, NOTHING, mirrored, query

from companion.core import geometry
from companion.core.gridmap import MapParams
from companion.core.types import F64
from companion.policy import headings
from companion.policy.decoder import (
    ACTION_SIZE,
    NAMES,
    DecoderParams,
    decode,
    encode_detour,
    mirror_action,
    proposal,
)
from companion.policy.expert import ExpertParams, GeometricExpert

P = DecoderParams()
UNIT = st.floats(-1.0, 1.0)
PLACE = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))


def action(*numbers: float) -> F64:
    return np.array([*numbers, *np.zeros(ACTION_SIZE - len(numbers))])


def test_zero_leads_straight_at_the_goal() -> None:
    path = decode("detour", action(), query(goal_ne_m=(0.0, 20.0)), P)
    assert path == pytest.approx(np.outer(np.arange(1, 6) / 5 * 4.0, [0.0, 1.0]))


def test_side_turns_the_chord_to_the_right_and_spacing_sets_the_length() -> None:
    half_pi = math.pi / 2 / P.side_rad
    path = decode("detour", action(half_pi, 0.0, 1.0), query(), P)
    assert path[-1] == pytest.approx([0.0, P.long_m])
    path = decode("detour", action(-half_pi, 0.0, -1.0), query(), P)
    assert path[-1] == pytest.approx([0.0, -P.short_m])


def test_turn_spreads_the_courses_of_the_legs_about_the_chord() -> None:
    path = decode("detour", action(0.0, 0.5, 0.0), query(), P)
    legs = np.diff(np.concatenate([np.zeros((1, 2)), path]), axis=0)
    assert np.arctan2(legs[:, 1], legs[:, 0]) == pytest.approx([-0.5, -0.25, 0.0, 0.25, 0.5])
    assert path[-1, 1] == pytest.approx(0.0)
    assert np.hypot(legs[:, 0], legs[:, 1]) == pytest.approx(np.full(5, 0.8))


def test_waypoints_are_three_metres_times_the_action_relative_to_the_nose() -> None:
    facing_east = query(pos_ne_m=(1.0, 2.0), yaw_rad=math.pi / 2)
    path = decode("waypoints", np.array([1.0, 0.0, 1.0, 0.5, 1.0, 1.0, 0.0, 1.0, -1.0, 0.0]), facing_east, P)
    assert path == pytest.approx(np.array([[1.0, 5.0], [-0.5, 5.0], [-2.0, 5.0], [-2.0, 2.0], [1.0, -1.0]]))


def test_a_path_goes_on_where_the_committed_stretch_ends() -> None:
    asked = query(prefix_ne_m=[(0.0, 0.5), (0.5, 0.5), (1.0, 0.5)], goal_ne_m=(20.0, 0.5))
    offered = proposal("detour", action(), asked, P).waypoints_ne_m
    assert offered[:, 1] == pytest.approx(0.5)
    assert (np.diff(offered[:, 0]) > 0.0).all()
    assert offered[-4:, 0] == pytest.approx([2.6, 3.4, 4.2, 5.0])


def test_the_corner_at_the_anchor_is_a_parabola_that_cuts_thirty_centimetres() -> None:
    asked = query(prefix_ne_m=[(0.0, 0.0), (1.0, 0.0)], goal_ne_m=(1.0, 20.0))
    offered = proposal("detour", action(), asked, P).waypoints_ne_m
    reach_m = 0.6 / math.sin(math.pi / 4.0)
    assert offered[0] == pytest.approx([1.0 - reach_m, 0.0])
    assert math.dist(offered[2].tolist(), (1.0, 0.0)) == pytest.approx(0.3)
    assert offered[4] == pytest.approx([1.0, reach_m])
    assert offered[5:] == pytest.approx(np.array([[1.0, 1.6], [1.0, 2.4], [1.0, 3.2], [1.0, 4.0]]))


@given(UNIT, UNIT, UNIT, st.floats(0.0, 1.5))
def test_rounding_leaves_the_corner_by_no_more_than_thirty_centimetres(
    side: float, turn: float, spacing: float, stretch_m: float
) -> None:
    asked = query(prefix_ne_m=[(0.0, 0.0), (0.6 * stretch_m, 0.0), (stretch_m, 0.0)])
    sharp = np.concatenate([asked.prefix_ne_m, decode("detour", action(side, turn, spacing), asked, P)])
    offered = proposal("detour", action(side, turn, spacing), asked, P).waypoints_ne_m
    whole = np.concatenate([asked.prefix_ne_m[:1], offered])
    assert geometry.points_to_polyline_distance(sharp, whole).max() <= 0.3 + 1e-9
    assert offered[-1] == pytest.approx(sharp[-1])
    assert geometry.length(whole) <= geometry.length(sharp) + 1e-9


def test_a_detour_has_next_choices_farther_aside_first_and_then_shorter_ones() -> None:
    asked = query(goal_ne_m=(20.0, 0.0))
    offered = proposal("detour", action(0.25, 0.0, 1.0), asked, P)
    ends = np.array([path[-1] for path in offered.others_ne_m])
    assert np.arctan2(ends[:, 1], ends[:, 0])[:4] == pytest.approx([0.85, 0.55, 1.0, 0.4])
    assert np.hypot(*ends.T) == pytest.approx([P.long_m] * 8 + [0.6 * P.long_m] * 17)
    image = proposal("detour", mirror_action("detour", action(0.25, 0.0, 1.0)), mirrored(asked), P)
    assert all(
        there == pytest.approx(here * EAST) for here, there in zip(offered.others_ne_m, image.others_ne_m, strict=True)
    )
    assert proposal("detour", action(0.25), asked, DecoderParams(aside_rad=0.0)).others_ne_m == ()


def test_a_path_does_not_lead_past_the_goal_and_ends_there_if_near() -> None:
    path = decode("detour", action(0.0, 0.0, 1.0), query(goal_ne_m=(2.5, 0.0)), P)
    assert path[-1] == pytest.approx([2.5, 0.0])
    slightly_right = decode("detour", action(0.1, 0.0, 1.0), query(goal_ne_m=(2.5, 0.0)), P)
    assert slightly_right[-1].tolist() == [2.5, 0.0]
    away = decode("detour", action(-1.0, 0.0, 1.0), query(goal_ne_m=(2.5, 0.0)), P)
    assert np.hypot(*away[-1]) == pytest.approx(P.long_m)


@given(UNIT, UNIT, UNIT, PLACE, st.floats(0.01, 40.0))
def test_no_path_leads_past_the_goal(side: float, turn: float, spacing: float, pos, goal_m: float) -> None:
    asked = query(pos_ne_m=pos, goal_ne_m=(pos[0] + goal_m, pos[1]))
    path = decode("detour", action(side, turn, spacing), asked, P)
    assert path[-1, 0] - pos[0] <= goal_m + 1e-9
    whole = geometry.length(np.concatenate([asked.prefix_ne_m, path]))
    assert whole <= P.long_m + 2.0 * P.goal_hint_m


@given(st.sampled_from(NAMES), st.lists(UNIT, min_size=10, max_size=10), PLACE, st.floats(-3.0, 3.0), PLACE)
def test_mirrored_query_and_action_give_mirrored_waypoints(name, numbers, pos, yaw: float, ahead) -> None:
    asked = query(pos, prefix_ne_m=[pos, (pos[0] + 0.3, pos[1] + 0.1)], goal_ne_m=(15.0, ahead[1]), yaw_rad=yaw)
    path = decode(name, np.array(numbers), asked, P)
    image = decode(name, mirror_action(name, np.array(numbers)), mirrored(asked), P)
    assert image == pytest.approx(path * EAST, abs=1e-9)


@given(st.floats(-0.95, 0.95), st.floats(-0.8, 0.8), UNIT, PLACE)
def test_the_encoder_finds_the_action_of_a_detour_again(side: float, turn: float, spacing: float, pos) -> None:
    asked = query(pos, goal_ne_m=(30.0, 5.0))
    path = decode("detour", action(side, turn, spacing), asked, P)
    again = encode_detour(path, asked, P)
    assert again[:3] == pytest.approx([side, turn, spacing], abs=0.06)
    assert decode("detour", again, asked, P) == pytest.approx(path, abs=0.15)


def test_the_encoder_leaves_out_the_committed_stretch_and_follows_as_far_as_it_can() -> None:
    asked = query(prefix_ne_m=[(0.0, 0.0), (1.0, 0.0)])
    taught = np.array([[1.0, 0.0], [4.0, 0.0], [4.0, 4.0]])  # straight on, then a sharp right turn
    got = encode_detour(taught, asked, P)
    path = decode("detour", got, asked, P)
    rest = np.array([[1.0, 0.0], [4.0, 0.0], [4.0, 4.0]])
    assert geometry.points_to_polyline_distance(rest, path).max() < 0.3
    assert 3.0 <= geometry.length(np.concatenate([rest[:1], path])) < 6.0


def test_the_experts_path_round_a_wall_can_be_said_as_a_detour() -> None:
    wall = np.stack([np.full(60, 4.0), np.linspace(-4.0, 1.5, 60)], axis=1)
    asked = query(hits_ne_m=wall)
    taught, _ = GeometricExpert(ExpertParams(), MapParams()).propose(asked, None)
    assert taught is not None
    path = decode("detour", encode_detour(taught.waypoints_ne_m, asked, P), asked, P)
    assert geometry.nearest_distance(np.concatenate([asked.prefix_ne_m, path]), wall) > 0.33
    right = headings.encode_heading(taught.waypoints_ne_m, asked, P)
    assert 0.2 < right < 0.9


def test_the_best_heading_is_refined_towards_the_better_neighbour() -> None:
    ways = headings.headings_rad(P)
    logits = np.zeros(headings.HEADINGS)
    logits[24:27] = 1.0, 3.0, 2.0
    step = ways[1] - ways[0]
    assert headings.refined(logits, 25, ways) == pytest.approx(ways[25] + step / 6.0)
    assert headings.refined(logits[::-1], 15, ways) == pytest.approx(ways[15] - step / 6.0)
    assert headings.refined(np.eye(41)[0], 0, ways) == pytest.approx(-P.side_rad)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_a_ranking_gives_the_best_path_and_the_next_thirteen(seed: int) -> None:
    logits = np.random.default_rng(seed).normal(scale=0.5, size=headings.HEADINGS)
    asked = query(prefix_ne_m=[(0.0, 0.0), (0.7, 0.1)], hits_ne_m=NOTHING)
    offered, best = headings.ranked(logits, asked, P)
    ways = headings.headings_rad(P)
    order = np.argsort(-logits)
    assert abs(best - ways[order[0]]) <= (ways[1] - ways[0]) / 2 + 1e-9
    assert len(offered.others_ne_m) == headings.NEXT_CHOICES
    assert all(np.isfinite(path).all() for path in (offered.waypoints_ne_m, *offered.others_ne_m))
    towards = offered.others_ne_m[-headings.NEXT_HEADINGS][-1] - asked.prefix_ne_m[-1]
    goal = math.atan2(-0.1, 19.3)
    assert math.remainder(math.atan2(towards[1], towards[0]) - goal - ways[order[1]], math.tau) == pytest.approx(0.0)
    image, turned = headings.ranked(headings.mirror_logits(logits), mirrored(asked), P)
    assert turned == pytest.approx(-best)
    assert image.others_ne_m[-1] == pytest.approx(offered.others_ne_m[-1] * EAST)
