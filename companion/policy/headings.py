"""Which way, of forty-one? A head that ranks headings off the goal bearing; pure; right is positive.

Where a path may lead round an obstacle on either side, a number would average the two and lead into it; a ranking keeps
them apart, and the second choice is there for when the checker does not keep the first.
"""

from functools import cache

import numpy as np

from companion.core import geometry
from companion.core.types import F64
from companion.policy.band import between, fits
from companion.policy.decoder import SHORT, Choices, DecoderParams, arc, beyond_anchor, joined
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import Proposal, Query

HEADINGS = 41
NEXT_HEADINGS = 13  # behind the best
ASIDE = (0.0, 1.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0)  # of the step between headings: gaps are narrower than it
LENGTHS = (1.0, SHORT, SHORT * SHORT)  # shares of the length: as far as the gap's mouth, where the whole does not fit
NEXT_CHOICES = len(LENGTHS) * len(ASIDE) - 1 + NEXT_HEADINGS
AGAINST = 4.0  # nats: a heading that much less likely than the best is no choice; rather through at less margin
STEADY = 5.0  # nats against turning back: without, flights swung to and fro before what they could not pass
LASTS_S = 0.8  # a straight path is replaced after this long: at 0.4 s flights were as long, at 3 s a tenth longer
SHORTEST = 1.0 / 4.0  # of the length: chord of a teacher's path that its heading is read from, at least
STEP = 1.0 / 16.0  # of the length: by which chords are shortened, and how far they may leave the path


def headings_rad(params: DecoderParams) -> F64:
    """(41,) the headings off the goal bearing, left to right; the middle one is the goal's."""
    return np.linspace(-params.side_rad, params.side_rad, HEADINGS)


def ranked(logits: F64, query: Query, params: DecoderParams, hits_ne_m: F64 | None = None) -> tuple[Proposal, float]:
    """Straight paths along the best heading, refined; close by it, shorter, along the next ones; and that heading.

    ``hits_ne_m`` (h, 2): the paths are pushed to the middle between them, and where one along the best heading fits
    there are no next ones: the checker would rather have any that has its full margin. None: straight, and all of them.
    """
    headings = headings_rad(params)
    order = np.argsort(-logits, kind="stable")[: NEXT_HEADINGS + 1]
    order = order[logits[order] >= logits[order[0]] - AGAINST]
    best = refined(logits, int(order[0]), headings)
    close_by = [best + share * float(headings[1] - headings[0]) for share in ASIDE]
    whole_m = params.headings_m
    choices = [(heading, share * whole_m) for share in LENGTHS for heading in close_by]

    @cache
    def path(heading_rad: float, length_m: float) -> F64:
        way = arc(heading_rad, 0.0, length_m, query, params)
        return joined(query, way if hits_ne_m is None else between(way, hits_ne_m, query))

    if hits_ne_m is None or not any(fits(path(*choice), hits_ne_m, query) for choice in choices):
        choices += [(heading, whole_m) for heading in headings[order[1:]].tolist()]
    return Proposal(path(*choices[0]), Choices(choices[1:], path), LASTS_S), best


def steadied(logits: F64, last_rad: float | None, params: DecoderParams) -> F64:
    """The ranking with a bias towards the last heading, both off the goal bearing: turning back wants to be surer."""
    if last_rad is None:
        return logits
    steady: F64 = logits - STEADY * (1.0 - np.cos(headings_rad(params) - last_rad)) / 2.0
    return steady


def refined(logits: F64, best: int, headings: F64) -> float:
    """Top of the parabola through the best heading and its neighbours; the heading itself at either end."""
    heading = float(headings[best])
    if not 0 < best < len(headings) - 1:
        return heading
    left, middle, right = logits[best - 1 : best + 2].tolist()
    bend = left - 2.0 * middle + right
    share = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return heading + share * float(headings[1] - headings[0])


def encode_heading(path_ne_m: F64, query: Query, params: DecoderParams) -> float:
    """Heading off the goal bearing of the longest chord of a teacher's path, from the anchor, that stays near the path.

    Args: as of ``encode_detour``.
    """
    rest = goal_frame(query).from_ne(beyond_anchor(path_ne_m, query))
    length_m, step_m = min(params.headings_m, geometry.length(rest)), STEP * params.headings_m
    while length_m - step_m >= SHORTEST * params.headings_m:
        part = geometry.part(rest, 0.0, length_m)
        if geometry.points_to_polyline_distance(part[[0, -1]], part).max() <= step_m:
            break
        length_m -= step_m
    end = geometry.point_at(rest, length_m)
    return float(np.clip(np.arctan2(end[1], end[0]), -params.side_rad, params.side_rad))


def mirror_logits(logits: F64) -> F64:
    """The ranking (..., 41) of the mirror image."""
    mirrored: F64 = logits[..., ::-1]
    return mirrored
