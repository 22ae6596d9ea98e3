"""Which opening leads on? VFH* with a planned sub-goal, fuzzy speed and a safety barrier; pure, local NED.

* Openings of a polar histogram of the remembered obstacles, grown by the vehicle: I. Ulrich, J. Borenstein, "VFH+:
  reliable obstacle avoidance for fast mobile robots", ICRA 1998.
* The opening whose consequences are best, a few steps on: the same, "VFH*: local obstacle avoidance with look-ahead
  verification", ICRA 2000. A vehicle that flies any way needs no masking by turning circles.
* What the winners of BARN 2025 and 2026 put round it, as far as it is told: a sub-goal from A* on the rolling grid
  (that of ``astar`` here), speed by fuzzy rules, and a barrier that takes out of the velocity what closes in too fast.
  Rules and barrier are our own; their figures were not to be had.
"""

import heapq
import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from companion.core import geometry
from companion.core.geometry import points_near
from companion.core.params import param
from companion.core.types import F64
from companion.guidance import follower
from companion.guidance.limits import stopping_speed
from mission.pilots import cockpit
from mission.pilots.astar import AstarParams, Plan, replan
from mission.pilots.cockpit import Recipe, View, Wish
from mission.pilots.dwa import free_ways

SECTORS = 72
SECTOR_RAD = math.tau / SECTORS
COURSES = np.arange(SECTORS) * SECTOR_RAD  # from north
BARRIER_ROUNDS = 4
WINDOWS = (1.0, 0.6, 0.35)  # shares of window and sub-goal distance that are tried
TOWARDS_RAD = math.pi / 4.0  # a course within this of the sub-goal's leads towards it


@dataclass(frozen=True, slots=True)
class VfhParams:
    """Histogram, look-ahead, speed rules and barrier, tuned."""

    margin_m: float = param(0.12, "VFH_MARGIN", "Obstacles are grown by radius and this", "m", 0.0, 2.0)
    window_m: float = param(3.0, "VFH_WINDOW", "Obstacles farther away than this do not count", "m", 0.5, 20.0)
    high: float = param(0.45, "VFH_HIGH", "Density from which a sector is blocked", "", 0.0, 10.0)
    low: float = param(0.30, "VFH_LOW", "Density below which it is free again", "", 0.0, 10.0)
    wide: int = param(14, "VFH_WIDE", "Sectors from which on an opening is wide", "", 2, 72)
    to_goal: float = param(5.0, "VFH_TO_GOAL", "Weight of the difference to the target (mu1)", "", 0.0, 50.0)
    to_course: float = param(1.5, "VFH_TO_COURSE", "Weight of the difference to the course flown (mu2)", "", 0.0, 50.0)
    to_last: float = param(2.0, "VFH_TO_LAST", "Weight of the difference to the last choice (mu3)", "", 0.0, 50.0)
    depth: int = param(3, "VFH_DEPTH", "Steps of the look-ahead (1: VFH+)", "", 1, 8)
    step_m: float = param(0.7, "VFH_STEP", "Length of one", "m", 0.1, 5.0)
    discount: float = param(0.8, "VFH_DISCOUNT", "Weight of each further step", "", 0.1, 1.0)
    tries: int = param(40, "VFH_TRIES", "Histograms that one decision may look at", "", 1, 1000)
    period_s: float = param(0.12, "VFH_PERIOD", "Time between two decisions", "s", 0.02, 2.0)
    subgoal_m: float = param(2.5, "VFH_SUBGOAL", "How far ahead on the plan the sub-goal lies", "m", 0.3, 20.0)
    slow_share: float = param(0.25, "VFH_SLOW", "Share of the cap that is slow", "", 0.01, 1.0)
    free_near_m: float = param(0.5, "VFH_FREE_NEAR", "Free way that is short", "m", 0.0, 10.0)
    free_far_m: float = param(2.0, "VFH_FREE_FAR", "Free way that is long", "m", 0.1, 20.0)
    side_near_m: float = param(0.05, "VFH_SIDE_NEAR", "Distance from the hull that is near", "m", 0.0, 5.0)
    side_far_m: float = param(0.5, "VFH_SIDE_FAR", "Distance from the hull that is far", "m", 0.05, 5.0)
    barrier_1_s: float = param(1.6, "VFH_BARRIER", "Closing speed allowed per metre of distance", "1/s", 0.1, 10.0)
    barrier_m: float = param(0.05, "VFH_BARRIER_D", "Distance from the hull that the barrier keeps", "m", 0.0, 2.0)


@dataclass(frozen=True, slots=True)
class Own:
    """What is remembered from tick to tick."""

    plan: Plan | None = None
    course_rad: float | None = None  # chosen last
    blocked: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(SECTORS, bool))
    decided_t_s: float = -math.inf


class Vfh(Recipe):
    """Pilot 'vfh'."""

    name = "vfh"
    source = "VFH+ (Ulrich, Borenstein 1998), VFH* (2000), A* sub-goal, fuzzy speed, barrier: the BARN 2025-26 recipe"

    def __init__(self, params: VfhParams | None = None, planner: AstarParams | None = None) -> None:
        self._params = params or VfhParams()
        self._planner = planner or AstarParams()

    def steer(self, view: View, own: Own | None) -> tuple[Own, Wish]:
        """See ``Recipe.steer``."""
        params, own = self._params, own or Own()
        plan, planned = self._planned(view, own.plan)
        near = points_near(
            view.pos_ne_m[None], view.percept.points_ne_m, params.window_m + params.depth * params.step_m
        )
        own = replace(own, plan=plan)
        if view.state.t_s - own.decided_t_s >= params.period_s - 1e-6:
            own = self._decided(view, own, near)
        if own.course_rad is None:
            return own, Wish("blocked", decided=planned)
        velocity = self._velocity(view, own.course_rad, near, own.plan)
        path = None if plan is None else plan.path_ne_m
        return own, Wish("vfh", velocity, decided=planned, path_ne_m=path)

    def _planned(self, view: View, plan: Plan | None) -> tuple[Plan | None, bool]:
        due = plan is None or view.state.t_s - plan.t_s >= self._planner.period_s - 1e-6
        if due:
            plan = replan(view, plan, self._planner)
        if plan is not None:
            at = follower.progress(plan.path_ne_m, view.pos_ne_m, plan.s_m, view.params.follower)
            plan = replace(plan, s_m=at.s_m)
        return plan, due

    def _decided(self, view: View, own: Own, near: F64) -> Own:
        """Look at less and less around, and at a nearer sub-goal, until an opening leads towards it."""
        moving = float(np.hypot(*view.vel_ne_m_s)) > cockpit.COURSE_FROM_M_S
        flown = math.atan2(*view.vel_ne_m_s[::-1]) if moving else None
        margin_m = self._params.margin_m
        if own.plan is not None:
            margin_m = min(margin_m, own.plan.margin_m)  # no more than the plan found room for
        radius_m = view.params.vehicle.radius_m + margin_m
        course, blocked = None, own.blocked
        for share in WINDOWS:
            params = replace(self._params, window_m=share * self._params.window_m)
            target = self._target(view, own.plan, share * self._params.subgoal_m)
            blocked = histogram(view.pos_ne_m, near, radius_m, own.blocked, params)
            course = best_course(_Step(view.pos_ne_m, blocked, flown, own.course_rad), target, near, radius_m, params)
            offset = target - view.pos_ne_m
            if course is not None and abs(_difference(course, math.atan2(*offset[::-1]))) < TOWARDS_RAD:
                break
        return replace(own, course_rad=course, blocked=blocked, decided_t_s=view.state.t_s)

    def _target(self, view: View, plan: Plan | None, ahead_m: float) -> F64:
        return view.task.goal_ned_m if plan is None else geometry.point_at(plan.path_ne_m, plan.s_m + ahead_m)

    def _velocity(self, view: View, course_rad: float, near: F64, plan: Plan | None) -> F64:
        hull_m = view.params.vehicle.radius_m
        free_m = float(free_ways(view.pos_ne_m, np.array([course_rad]), near, hull_m, self._params.window_m)[0])
        side_m = geometry.nearest_distance(view.pos_ne_m[None], near) - hull_m
        turn_rad = 0.0
        if float(np.hypot(*view.vel_ne_m_s)) > cockpit.COURSE_FROM_M_S:
            turn_rad = abs(_difference(math.atan2(*view.vel_ne_m_s[::-1]), course_rad))
        speed = view.approach_m_s * fuzzy_share(free_m, side_m, turn_rad, self._params)
        wanted = speed * np.array([math.cos(course_rad), math.sin(course_rad)])
        kept_m = self._params.barrier_m if plan is None else min(self._params.barrier_m, plan.margin_m)
        return barrier(wanted, near - view.pos_ne_m, hull_m + kept_m, self._params)


def histogram(
    place_ne_m: F64, points_ne_m: F64, radius_m: float, before: NDArray[np.bool_], params: VfhParams
) -> NDArray[np.bool_]:
    """(SECTORS,) blocked courses: density of grown obstacles per sector, with hysteresis.

    The density of one obstacle falls linearly with the square of its distance, from 1 at the hull to 0 at the window.
    """
    offset = points_ne_m - place_ne_m
    distance = np.hypot(offset[:, 0], offset[:, 1])
    near = distance < params.window_m
    offset, distance = offset[near], np.maximum(distance[near], 1e-6)
    if len(offset) == 0:
        return np.zeros(SECTORS, bool)
    share = 1.0 - np.clip((distance**2 - radius_m**2) / (params.window_m**2 - radius_m**2), 0.0, 1.0)
    grown = np.arcsin(np.minimum(radius_m / distance, 1.0))
    off = np.abs((COURSES[:, None] - np.arctan2(offset[:, 1], offset[:, 0]) + math.pi) % math.tau - math.pi)
    density = ((off <= grown) * share).sum(axis=1)
    blocked: NDArray[np.bool_] = np.where(before, density >= params.low, density > params.high)
    return blocked


def openings(blocked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sector and length of each run of free sectors, round the circle."""
    if not blocked.any():
        return [(0, SECTORS)]
    first = int(np.argmax(blocked))
    runs = []
    position = 0
    for taken, group in itertools.groupby(np.roll(blocked, -first).tolist()):
        length = len(list(group))
        if not taken:
            runs.append(((first + position) % SECTORS, length))
        position += length
    return runs


def candidates(blocked: NDArray[np.bool_], target_rad: float, params: VfhParams) -> list[float]:
    """Courses worth a look: the middle of narrow openings, both sides of wide ones, and the target where it is free."""
    courses = []
    for first, length in openings(blocked):
        start = first * SECTOR_RAD
        if length == SECTORS:
            return [target_rad]
        if length < params.wide:
            courses.append(start + (length - 1) / 2.0 * SECTOR_RAD)
            continue
        half = params.wide / 2.0 * SECTOR_RAD
        end = start + (length - 1) * SECTOR_RAD
        courses += [start + half, end - half]
        if half <= (target_rad - start) % math.tau <= end - half - start:
            courses.append(target_rad)
    return courses


@dataclass(frozen=True, slots=True)
class _Step:
    """A place of the look-ahead, and how it was come to."""

    place_ne_m: F64
    blocked: NDArray[np.bool_]
    course_rad: float | None  # flown there
    last_rad: float | None  # chosen before
    depth: int = 0
    first_rad: float | None = None  # of the root's candidates, the one that led here


def best_course(root: _Step, target_ne_m: F64, near: F64, radius_m: float, params: VfhParams) -> float | None:
    """The first course of the cheapest way ``depth`` steps on; None where the root has no opening (best first)."""
    order = itertools.count()
    queue: list[tuple[float, int, _Step]] = [(0.0, next(order), root)]
    best: tuple[int, float | None] = (0, None)  # deepest reached so far, should the tries run out
    for _ in range(params.tries):
        if not queue:
            break
        cost, _, step = heapq.heappop(queue)
        if step.depth > best[0]:
            best = (step.depth, step.first_rad)
        if step.depth == params.depth:
            break
        offset = target_ne_m - step.place_ne_m
        target_rad = math.atan2(float(offset[1]), float(offset[0]))
        for course in candidates(step.blocked, target_rad, params):
            spent = cost + params.discount**step.depth * _cost(course, target_rad, step, params)
            heapq.heappush(queue, (spent, next(order), _next(step, course, near, radius_m, params)))
    return best[1]


def _next(step: _Step, course_rad: float, near: F64, radius_m: float, params: VfhParams) -> _Step:
    place = step.place_ne_m + params.step_m * np.array([math.cos(course_rad), math.sin(course_rad)])
    first = course_rad if step.first_rad is None else step.first_rad
    last_ring = step.depth + 1 == params.depth  # its openings are not looked at
    blocked = step.blocked if last_ring else histogram(place, near, radius_m, np.zeros(SECTORS, bool), params)
    return _Step(place, blocked, course_rad, course_rad, step.depth + 1, first)


def _cost(course_rad: float, target_rad: float, step: _Step, params: VfhParams) -> float:
    cost = params.to_goal * abs(_difference(course_rad, target_rad))
    if step.course_rad is not None:
        cost += params.to_course * abs(_difference(course_rad, step.course_rad))
    if step.last_rad is not None:
        cost += params.to_last * abs(_difference(course_rad, step.last_rad))
    return cost


def fuzzy_share(free_m: float, side_m: float, turn_rad: float, params: VfhParams) -> float:
    """Share of the cap, by rules: long way, nothing beside and straight on is fast; any of them wrong is slow.

    Three memberships, the least of them is how true "fast" is (Mamdani's and), and the two speeds are weighed by it.
    """
    long = _membership(free_m, params.free_near_m, params.free_far_m)
    clear = _membership(side_m, params.side_near_m, params.side_far_m)
    straight = 1.0 - _membership(turn_rad, 0.0, math.pi / 2.0)
    fast = min(long, clear, straight)
    return params.slow_share + (1.0 - params.slow_share) * fast


def barrier(velocity_m_s: F64, offset_m: F64, kept_m: float, params: VfhParams) -> F64:
    """The velocity without what closes in on a point faster than its distance allows (a control barrier function).

    Allowed towards a point that is h farther away than ``kept_m``: ``barrier_1_s`` h, never more than stops within h.
    Where h is negative the point is moved away from. The worst point is taken out in turn.
    """
    distance = np.hypot(offset_m[:, 0], offset_m[:, 1])
    near = distance < kept_m + 2.0
    if not near.any():
        return velocity_m_s
    towards = offset_m[near] / np.maximum(distance[near], 1e-6)[:, None]
    room = distance[near] - kept_m
    allowed = np.minimum(params.barrier_1_s * room, [stopping_speed(m) if m > 0.0 else m for m in room.tolist()])
    for _ in range(BARRIER_ROUNDS):
        excess = towards @ velocity_m_s - allowed
        worst = int(np.argmax(excess))
        if excess[worst] <= 1e-9:
            return velocity_m_s
        velocity_m_s = velocity_m_s - excess[worst] * towards[worst]
    left = float((towards @ velocity_m_s - allowed).max())
    return velocity_m_s if left < 0.05 else np.zeros(2)  # between two points that leave no way: stand


def _membership(value: float, low: float, high: float) -> float:
    return min(max((value - low) / (high - low), 0.0), 1.0) if value > low else 0.0


def _difference(a_rad: float, b_rad: float) -> float:
    return (a_rad - b_rad + math.pi) % math.tau - math.pi
