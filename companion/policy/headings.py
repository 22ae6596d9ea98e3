"""Which way, of forty-one? A head that ranks headings off the goal bearing; pure; right is positive.

Where a path may lead round an obstacle on either side, a number would average the two and lead into it; a ranking keeps
them apart, and the second choice is there for when the checker does not keep the first.
"""

import numpy as np

from companion.core import geometry
from companion.core.types import F64
from companion.policy.decoder import SHORT, DecoderParams, arc, beyond_anchor, joined
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import Proposal, Query

HEADINGS = 41
NEXT_HEADINGS = 13  # behind the best
ASIDE = (0.0, 1.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0, -2.0 / 3.0)  # of the step between headings: gaps are narrower than it
NEXT_CHOICES = 2 * len(ASIDE) - 1 + NEXT_HEADINGS
LASTS_S = 0.8  # a straight path is replaced after this long: at 0.4 s flights were as long, at 3 s a tenth longer
SHORTEST_M = 1.0  # chord of a teacher's path that its heading is read from, at least
STEP_M = 0.25


def headings_rad(params: DecoderParams) -> F64:
    """(41,) the headings off the goal bearing, left to right; the middle one is the goal's."""
    return np.linspace(-params.side_rad, params.side_rad, HEADINGS)


def ranked(logits: F64, query: Query, params: DecoderParams) -> tuple[Proposal, float]:
    """Straight paths along the best heading, refined; close by it, shorter, along the next ones; and that heading."""
    headings = headings_rad(params)
    order = np.argsort(-logits, kind="stable")[: NEXT_HEADINGS + 1].tolist()
    best = refined(logits, order[0], headings)
    close_by = [best + share * float(headings[1] - headings[0]) for share in ASIDE]
    whole_m, next_best = params.headings_m, headings[order[1:]].tolist()
    choices = [(heading, length_m) for length_m in (whole_m, SHORT * whole_m) for heading in close_by]
    choices += [(heading, whole_m) for heading in next_best]
    paths = [arc(heading, 0.0, length_m, query, params) for heading, length_m in choices]
    first, *others = (joined(query, path) for path in paths)
    return Proposal(first, tuple(others), LASTS_S), best


def refined(logits: F64, best: int, headings: F64) -> float:
    """Top of the parabola through the best heading and its neighbours; the heading itself at either end."""
    heading = float(headings[best])
    if not 0 < best < len(headings) - 1:
        return heading
    left, middle, right = logits[best - 1 : best + 2].tolist()
    bend = left - 2.0 * middle + right
    share = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return heading + share * float(headings[1] - headings[0])


def encode_heading(path_ne_m: F64, query: Query, params: DecoderParams, tolerance_m: float = 0.25) -> float:
    """Heading off the goal bearing of the longest chord of a teacher's path, from the anchor, that stays near the path.

    Args: as of ``encode_detour``.
    """
    rest = goal_frame(query).from_ne(beyond_anchor(path_ne_m, query))
    length_m = min(params.headings_m, geometry.length(rest))
    while length_m - STEP_M >= SHORTEST_M:
        part = geometry.part(rest, 0.0, length_m)
        if geometry.points_to_polyline_distance(part[[0, -1]], part).max() <= tolerance_m:
            break
        length_m -= STEP_M
    end = geometry.point_at(rest, length_m)
    return float(np.clip(np.arctan2(end[1], end[0]), -params.side_rad, params.side_rad))


def mirror_logits(logits: F64) -> F64:
    """The ranking (..., 41) of the mirror image."""
    mirrored: F64 = logits[..., ::-1]
    return mirrored
