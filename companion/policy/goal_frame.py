"""Where is ahead? The frame in which a learned policy sees and answers: x towards the goal, y to the right; pure.

Its origin is the anchor: the end of the committed stretch, where a new path begins. In this frame the same numbers mean
the same on a map never seen, and left and right are mirror images.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.types import F64
from companion.policy.interface import Query

AT_GOAL_M = 1e-6  # nearer than this the goal has no bearing: that of the line to it serves


@dataclass(frozen=True, slots=True)
class GoalFrame:
    """Origin and axis of the frame in local NED."""

    origin_ne_m: F64  # (2,) the anchor
    course_rad: float  # of the x axis: anchor to goal
    goal_m: float  # distance from the anchor to the goal

    def to_ne(self, points_m: F64) -> F64:
        """Places (k, 2) of the frame in local NED."""
        return self.origin_ne_m + points_m @ _rotation(self.course_rad).T

    def from_ne(self, points_ne_m: F64) -> F64:
        """Places (k, 2) of local NED in the frame."""
        return self.turned(points_ne_m - self.origin_ne_m)

    def turned(self, vectors_ne: F64) -> F64:
        """Directions or offsets (..., 2) of local NED along the axes of the frame."""
        turned: F64 = vectors_ne @ _rotation(self.course_rad)
        return turned


def goal_frame(query: Query) -> GoalFrame:
    """The frame of a query."""
    anchor = query.prefix_ne_m[-1]
    ahead = query.goal_ne_m - anchor
    goal_m = math.hypot(ahead[0], ahead[1])
    if goal_m < AT_GOAL_M:
        ahead = query.goal_ne_m - query.start_ne_m
    return GoalFrame(anchor, math.atan2(ahead[1], ahead[0]), goal_m)


def _rotation(angle_rad: float) -> F64:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s], [s, c]])
