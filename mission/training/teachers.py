"""Who says which heading is right? The geometric expert by its path, or who knows the true map, by seconds to the goal.

Both rank the 41 headings of a query. What the second knows no policy in flight does: a heading costs the time along its
straight path, slower beside obstacles as the navigator flies, and from its end on the time of the rest (``way_field``).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64
from companion.navigator import Params
from companion.policy import headings
from companion.policy.decoder import SHORT, DecoderParams
from companion.policy.expert import GeometricExpert
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import Query
from mission.flight_plan import FlightPlan
from mission.training import bc
from mission.training.bc import F32
from mission.training.way_field import speed_m_s, way_field
from mission.world_check import clearance_m

MARGIN_M = 0.05  # beyond the radius: the checker's least
STEP_M = 0.25  # along a heading


@dataclass(frozen=True, slots=True)
class Taught:
    """The answer to one query."""

    labels: F32  # (41,) chances
    heading_rad: float  # the best, off the goal bearing


class Teacher(Protocol):
    """One flight long."""

    def taught(self, query: Query) -> Taught | None:
        """The answer; None where no way is known."""
        ...


class ExpertTeacher:
    """The heading of the geometric expert's path, spread over its neighbours."""

    def __init__(self, params: Params, decoder_params: DecoderParams, sigma_rad: float) -> None:
        self._expert = GeometricExpert(params.expert, params.map)
        self._decoder_params, self._sigma_rad = decoder_params, sigma_rad
        self._way: F64 | None = None

    def taught(self, query: Query) -> Taught | None:
        """See ``Teacher``."""
        shown, self._way = self._expert.propose(query, self._way)
        if shown is None:
            return None
        heading_rad = headings.encode_heading(shown.waypoints_ne_m, query, self._decoder_params)
        return Taught(bc.spread(np.array([heading_rad]), self._decoder_params, self._sigma_rad)[0], heading_rad)


class MapTeacher:
    """The headings by what they cost on the true map of the flight."""

    def __init__(self, plan: FlightPlan, decoder_params: DecoderParams, temperature_s: float) -> None:
        self._plan, self._decoder_params, self._temperature_s = plan, decoder_params, temperature_s
        self._spawn_ne_m = np.array(plan.draws.spawn_ned_m[:2])

    def taught(self, query: Query) -> Taught | None:
        """See ``Teacher``."""
        cost_s = self.cost_s(query)
        if not np.isfinite(cost_s).any():
            return None
        best_rad = float(headings.headings_rad(self._decoder_params)[cost_s.argmin()])
        return Taught(bc.by_cost(cost_s[None], self._temperature_s)[0], best_rad)

    def cost_s(self, query: Query) -> F64:
        """(41,) by heading, left to right; inf where not even the short path is free."""
        frame, radius_m, cruise_m_s = goal_frame(query), query.radius_m, query.cruise_m_s
        whole_m = min(self._decoder_params.headings_m, max(frame.goal_m, STEP_M))
        along_m = np.arange(0.0, whole_m + STEP_M / 2, STEP_M)
        ways_rad = headings.headings_rad(self._decoder_params)
        rays = np.stack([np.cos(ways_rad), np.sin(ways_rad)], axis=1)
        places = frame.to_ne((along_m[:, None] * rays[:, None, :]).reshape(-1, 2)) + self._spawn_ne_m
        shape = (len(ways_rad), len(along_m))
        clearance = clearance_m(self._plan.world, places).reshape(shape)
        free = (clearance >= radius_m + MARGIN_M) & self._inside(places).reshape(shape)
        free[:, 0] = True  # it stands there
        last = np.logical_and.accumulate(free, axis=1).sum(axis=1) - 1  # free step of each path
        step_s = STEP_M / speed_m_s(clearance, radius_m, cruise_m_s)
        step_s[:, 0] = 0.0
        spent_s = step_s.cumsum(axis=1)
        rows = np.arange(len(ways_rad))
        field = way_field(self._plan.world, radius_m, cruise_m_s)
        rest_s = np.array([field.at(*end) for end in places.reshape(*shape, 2)[rows, last].tolist()])
        cost_s: F64 = np.where(along_m[last] >= SHORT * whole_m - STEP_M, spent_s[rows, last] + rest_s, np.inf)
        return cost_s

    def _inside(self, places: F64) -> NDArray[np.bool_]:
        n_min, e_min, n_max, e_max = self._plan.world.bounds_m
        within = (places > (n_min, e_min)) & (places < (n_max, e_max))
        inside: NDArray[np.bool_] = within[:, 0] & within[:, 1]
        return inside
