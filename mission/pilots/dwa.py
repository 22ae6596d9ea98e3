"""Which velocity, of those reachable soon, is best? The dynamic window approach for a multirotor; pure, local NED.

D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision avoidance", IEEE RAM 4(1), 1997: velocities that
can be reached within one interval, of those the ones from which it can stop before what lies on their way, of those the
one with the best weighted sum of heading, clearance and speed. A multirotor flies any way it is asked to, so velocities
are (north, east) and the ways are rays; obstacles are the remembered ones near by (the paper's obstacle line
field), as a rolling costmap would give them. No global plan: the paper has none.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.geometry import points_near
from companion.core.params import param
from companion.core.types import F64
from mission.pilots.cockpit import Recipe, View, Wish

DIRECTIONS = 72
SPEEDS = 8
WAYS = np.arange(DIRECTIONS, dtype=np.float64) * (math.tau / DIRECTIONS)


@dataclass(frozen=True, slots=True)
class DwaParams:
    """Weights of the objective and the window, tuned."""

    heading: float = param(0.8, "DWA_HEADING", "Weight of the heading (alpha)", "", 0.0, 10.0)
    clearance: float = param(0.4, "DWA_CLEAR", "Weight of the free way (beta)", "", 0.0, 10.0)
    speed: float = param(0.3, "DWA_SPEED", "Weight of the speed (gamma)", "", 0.0, 10.0)
    window_s: float = param(0.5, "DWA_WINDOW", "Velocities reachable within this time are looked at", "s", 0.05, 3.0)
    acc_m_s2: float = param(3.0, "DWA_ACC", "Acceleration that spans the window", "m/s2", 0.2, 7.0)
    decel_m_s2: float = param(2.5, "DWA_DECEL", "Deceleration that a velocity must be stopped with", "m/s2", 0.2, 7.0)
    delay_s: float = param(0.3, "DWA_DELAY", "Time that passes before braking bites", "s", 0.0, 2.0)
    tight_m: float = param(0.05, "DWA_TIGHT", "Margin beyond the radius, standing", "m", 0.0, 2.0)
    margin_m: float = param(0.25, "DWA_MARGIN", "The same at scale_m_s, growing with speed between", "m", 0.0, 2.0)
    scale_m_s: float = param(3.0, "DWA_SCALE", "Speed of the full margin", "m/s", 0.1, 20.0)
    reach_m: float = param(4.0, "DWA_REACH", "Free way that is as good as any", "m", 0.5, 20.0)


class Dwa(Recipe):
    """Pilot 'dwa'."""

    name = "dwa"
    source = "Fox, Burgard, Thrun 1997 (IEEE RAM 4:1), holonomic"

    def __init__(self, params: DwaParams | None = None) -> None:
        self._params = params or DwaParams()

    def steer(self, view: View, own: None) -> tuple[None, Wish]:
        """See ``Recipe.steer``."""
        params = self._params
        hull_m = view.params.vehicle.radius_m
        near = points_near(view.pos_ne_m[None], view.percept.points_ne_m, params.reach_m + hull_m + params.margin_m)
        # a tick and a half of delay is flown at the present velocity, whatever is asked for now
        begin = view.pos_ne_m + view.vel_ne_m_s * view.params.follower.delay_s
        course_rad: F64 = view.goal_course_rad + WAYS
        radii = [hull_m + margin(speed, params) for speed in _speeds(view.approach_m_s).tolist()]
        free = np.stack([free_ways(begin, course_rad, near, radius, params.reach_m) for radius in radii], axis=1)
        best = best_velocity(view, course_rad, free, params)
        return None, Wish("dwa", best, course_rad=view.goal_course_rad if best is None else None)


def free_ways(begin_ne_m: F64, course_rad: F64, points_ne_m: F64, radius_m: float, reach_m: float) -> F64:
    """(k,) metres along each course until the disc touches a point; at most ``reach_m``.

    A point already inside the disc blocks every course that does not lead away from it.
    """
    if len(points_ne_m) == 0:
        return np.full(len(course_rad), reach_m)
    offset = points_ne_m - begin_ne_m
    along = np.cos(course_rad)[:, None] * offset[:, 0] + np.sin(course_rad)[:, None] * offset[:, 1]
    square = (offset * offset).sum(axis=1)
    chord = radius_m * radius_m - (square - along * along)
    entry = np.where((chord > 0.0) & (along > 0.0), along - np.sqrt(np.maximum(chord, 0.0)), reach_m)
    free_m: F64 = np.clip(entry.min(axis=1), 0.0, reach_m)
    return free_m


def margin(speed_m_s: float, params: DwaParams) -> float:
    """Beyond the radius at that speed: the footprint grows with speed, as in ROS's dwa_local_planner."""
    share = min(speed_m_s / params.scale_m_s, 1.0)
    return params.tight_m + share * max(params.margin_m - params.tight_m, 0.0)


def stop_speed(free_m: F64, params: DwaParams) -> F64:
    """Largest admissible speed for each free way: what stops within it, delay counted."""
    lag = params.decel_m_s2 * params.delay_s
    speed: F64 = np.sqrt(lag * lag + 2.0 * params.decel_m_s2 * free_m) - lag
    return speed


def best_velocity(view: View, course_rad: F64, free_m: F64, params: DwaParams) -> F64 | None:
    """The admissible velocity (2,) in the window with the best objective; None: there is none, brake.

    ``free_m``: (k, SPEEDS), the free way of each course for the footprint of each speed.
    """
    cap = view.approach_m_s
    velocity = _candidates(view, course_rad, cap)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    free = free_m.ravel()
    fits = (speed <= stop_speed(free, params) + 1e-9) & _in_window(velocity, view, params)
    if not fits.any():
        return None
    off_rad = np.abs((np.repeat(course_rad, SPEEDS) - view.goal_course_rad + math.pi) % math.tau - math.pi)
    objective = (
        params.heading * (1.0 - off_rad / math.pi)
        + params.clearance * free / params.reach_m
        + params.speed * speed / max(cap, 1e-6)
    )
    best: F64 = velocity[int(np.argmax(np.where(fits, objective, -np.inf)))]
    return best


def _candidates(view: View, course_rad: F64, cap_m_s: float) -> F64:
    """(k * SPEEDS, 2) velocities: every course at every speed up to the cap."""
    direction = np.stack([np.cos(course_rad), np.sin(course_rad)], axis=1)
    velocities: F64 = (direction[:, None, :] * _speeds(cap_m_s)[None, :, None]).reshape(-1, 2)
    return velocities


def _speeds(cap_m_s: float) -> F64:
    speeds: F64 = cap_m_s * np.arange(1, SPEEDS + 1) / SPEEDS
    return speeds


def _in_window(velocity: F64, view: View, params: DwaParams) -> NDArray[np.bool_]:
    change = velocity - view.vel_ne_m_s
    inside: NDArray[np.bool_] = np.hypot(change[:, 0], change[:, 1]) <= params.acc_m_s2 * params.window_s
    return inside
