"""What does a planner fly that knows the whole world? OMPL on the true map: the oracle for path length.

I. Sucan, M. Moll, L. Kavraki, "The Open Motion Planning Library", IEEE RAM 2012; planner Informed RRT* (J. Gammell,
S. Srinivasa, T. Barfoot, IROS 2014), then OMPL's own shortcuts. It is told what stands where (not what moves), plans
once where OFFBOARD begins, and follows with the navigator's follower and limits, but for the clamp: nothing is unseen.
Only the stop rule looks at the scan. A way with less margin is taken where the full margin leaves none.
"""

import math
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from companion import navigator
from companion.core import geometry
from companion.core.params import param
from companion.core.types import F64
from companion.guidance import follower, limits
from companion.navigator.track import course_along
from mission.errors import InputError
from mission.pilots.astar import Plan
from mission.pilots.cockpit import Memory, Recipe, View, Wish, stop_needed
from sitl.world import World

SHARES = (1.0, 0.5, 0.25)  # of the margin
BACK_M = 1.0  # farther off its path than this it plans again


@dataclass(frozen=True, slots=True)
class OmplParams:
    """What the oracle may choose, tuned."""

    margin_m: float = param(0.3, "OMPL_MARGIN", "Planned clearance beyond the radius", "m", 0.0, 2.0)


@dataclass(frozen=True, slots=True)
class Own:
    """What came of planning."""

    plan: Plan | None  # None: there is no way


class Ompl(Recipe):
    """Pilot 'ompl'; flies only what it was ``told``."""

    name = "ompl"
    source = "OMPL 2 (Sucan, Moll, Kavraki 2012), Informed RRT* on the true map"

    def __init__(self, params: OmplParams | None = None, world: World | None = None, spawn: F64 | None = None) -> None:
        """Raises InputError where OMPL is not installed."""
        if find_spec("ompl") is None:
            raise InputError("pilot 'ompl' needs OMPL: pip install 'swiftnav[bench]'")
        self._params = params or OmplParams()
        self._world = world
        self._spawn_ned_m = np.zeros(2) if spawn is None else spawn

    def told(self, world: World, spawn_ned_m: F64) -> "Ompl":
        """See ``Oracle.told``."""
        return Ompl(self._params, world, np.array(spawn_ned_m[:2]))

    def start(self, params: navigator.Params) -> Memory:
        """Nothing planned. Raises InputError where it was not told the world."""
        if self._world is None:
            raise InputError("pilot 'ompl' flies only where it is told the world")
        return super().start(params)

    def steer(self, view: View, own: Own | None) -> tuple[Own, Wish]:
        """See ``Recipe.steer``."""
        due = own is None or (own.plan is not None and _off_m(view, own.plan) > BACK_M)
        if own is None or due:
            own = Own(self._planned(view))
        plan = own.plan
        if plan is None or stop_needed(view):
            return own, Wish("no way" if plan is None else "stop", decided=due)
        speed = _speed(view, plan)
        target = follower.Target(speed, view.down_m, view.yaw_sp_rad)
        at = follower.progress(plan.path_ne_m, view.state.pos_ned_m, plan.s_m, view.params.follower)
        followed = follower.follow(plan.path_ne_m, view.state, at, target, view.params.follower)
        course = course_along(plan.path_ne_m, plan.s_m)
        wish = Wish("follow", setpoint=followed.setpoint, course_rad=course, decided=due, path_ne_m=plan.path_ne_m)
        return Own(replace(plan, s_m=followed.s_m)), wish

    def _planned(self, view: View) -> Plan | None:
        from mission.pilots.ompl_path import ompl_path  # OMPL is an extra

        assert self._world is not None  # start refuses
        begin, end = view.pos_ne_m + self._spawn_ned_m, view.task.goal_ned_m + self._spawn_ned_m
        for share in SHARES:
            margin_m = share * self._params.margin_m
            path = ompl_path(self._world, begin, end, view.params.vehicle.radius_m + margin_m)
            if path is not None:
                return Plan(path - self._spawn_ned_m, 0.0, view.state.t_s, margin_m)
        return None


def _off_m(view: View, plan: Plan) -> float:
    distance_m = follower.progress(plan.path_ne_m, view.pos_ne_m, plan.s_m, view.params.follower).distance_m
    return distance_m if math.isfinite(distance_m) else 0.0


def _speed(view: View, plan: Plan) -> float:
    """Turns, end and clearance beside the path limit it; nothing ahead does."""
    params = view.params
    at = follower.progress(plan.path_ne_m, view.pos_ne_m, plan.s_m, params.follower)
    reach_m = params.limits.side_full_m + params.vehicle.radius_m
    stretch = geometry.part(plan.path_ne_m, at.s_m, at.s_m + reach_m)
    beside_m = geometry.nearest_distance(stretch, view.percept.static_ne_m, reach_m) - params.vehicle.radius_m
    ahead = limits.Ahead(math.inf, beside_m, 1.0)
    speed = limits.path_speed(plan.path_ne_m, at.s_m, view.task.cruise_m_s, ahead, params.limits)
    along = geometry.tangent_at(plan.path_ne_m, at.s_m)
    return limits.limit_rise(speed, view.state.vel_ned_m_s, along, params.limits)
