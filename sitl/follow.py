"""Where should the vehicle be right now in Follow Target? Local ned.

A task with memory: made when the mode begins to steer, asked for a demand at every control tick.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from companion.core.frames import wrap_rad
from companion.core.types import F64, VehicleState
from sitl.chaser import Chaser
from sitl.demand import Demand
from sitl.flight_tasks import hold
from sitl.guided_tasks import auto_pace, on_circle
from sitl.home import Home
from sitl.pilot import Sticks, expo
from sitl.px4_params import ParamStore

MOVING_M_S: Final = 0.5  # assumed: a target slower than this keeps its course
TARGET_LOST_S: Final = 8.0  # FollowTarget: TARGET_TIMEOUT_S

# FlightTaskAutoFollowTarget: what a stick at its stop changes in a second, and how far that goes
DISTANCE_M_S: Final = 2.0
HEIGHT_M_S: Final = 1.5
ANGLE_RAD_S: Final = 1.5
MIN_M: Final = 1.0
MAX_M: Final = 100.0
AHEAD_S: Final = 0.5  # it does not change while the vehicle is this far behind it


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Somebody to follow, as last heard."""

    t_s: float
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)


@dataclass(frozen=True, slots=True)
class Offset:
    """Where the vehicle is to be, seen from its target; also by how much it is not there yet."""

    height_m: float
    distance_m: float
    angle_rad: float  # from the target's course


class Perspective:
    """The offset that is flown: as the parameters say, until sticks change it."""

    def __init__(self, params: ParamStore) -> None:
        self._params = params
        self._configured = self.offset = _configured(params)

    def update(self) -> None:
        """A parameter that has changed is what counts now."""
        fresh, before, now = _configured(self._params), self._configured, self.offset
        self._configured = fresh
        self.offset = Offset(
            now.height_m if fresh.height_m == before.height_m else fresh.height_m,
            now.distance_m if fresh.distance_m == before.distance_m else fresh.distance_m,
            now.angle_rad if fresh.angle_rad == before.angle_rad else fresh.angle_rad,
        )

    def move(self, sticks: Sticks, missing: Offset, dt_s: float) -> None:
        """Throttle: height. Forward and back: distance. Right and left: angle, clockwise from above."""
        now, params = self.offset, self._params
        level, upright, dead_zone = params["MPC_XY_MAN_EXPO"], params["MPC_Z_MAN_EXPO"], params["MPC_HOLD_DZ"]
        turn_rad_s = min(ANGLE_RAD_S, params["FLW_TGT_MAX_VEL"] / now.distance_m)
        up = _step(missing.height_m, HEIGHT_M_S, HEIGHT_M_S) * expo(sticks.up, upright, dead_zone) * dt_s
        out = _step(missing.distance_m, DISTANCE_M_S, DISTANCE_M_S) * expo(sticks.forward, level, dead_zone) * dt_s
        round_ = _step(missing.angle_rad, ANGLE_RAD_S, turn_rad_s) * expo(sticks.right, level, dead_zone) * dt_s
        self.offset = Offset(
            min(max(now.height_m + up, MIN_M), MAX_M),
            min(max(now.distance_m + out, MIN_M), MAX_M),
            wrap_rad(now.angle_rad + round_),
        )


class Follow:
    """Keep a place relative to somebody who moves, nose towards them."""

    def __init__(
        self,
        state: VehicleState,
        latest: Callable[[], Target | None],
        params: ParamStore,
        home: Home,
        hands: Callable[[float], Sticks],
    ) -> None:
        """``hands``: the sticks at a time, centred where there are none."""
        self._latest = latest
        self._params = params
        self._home = home
        self._hands = hands
        self._perspective = Perspective(params)
        self._chaser = Chaser(state)
        self._stay = hold(state)
        self._course_rad = math.nan
        self._t_s = state.t_s

    def demand(self, state: VehicleState) -> Demand:
        """The point that runs after the place; without a target, stay."""
        dt_s, self._t_s = state.t_s - self._t_s, state.t_s
        self._perspective.update()
        target = self._latest()
        if target is None or state.t_s - target.t_s > TARGET_LOST_S:
            return self._stay.demand(state)
        there = target.pos_ned_m + target.vel_ned_m_s * (state.t_s - target.t_s)
        course_rad = self._course(state, target, there)
        self._perspective.move(self._hands(state.t_s), self._missing(state, there, course_rad), dt_s)
        offset = self._perspective.offset
        place = on_circle(there, offset.distance_m, course_rad + offset.angle_rad)
        place[2] = self._ground_down_m(there) - offset.height_m
        north_m, east_m = (there - state.pos_ned_m)[:2]
        speed_m_s = float(np.linalg.norm(target.vel_ned_m_s)) + max(1.0, self._params["FLW_TGT_MAX_VEL"])
        pace = auto_pace(self._params, speed_m_s)
        demand = self._chaser.run(state.t_s, place, pace, math.atan2(east_m, north_m))
        self._stay = hold(state)
        return demand

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False

    def _ground_down_m(self, there: F64) -> float:
        return float(there[2]) if self._params["FLW_TGT_ALT_M"] == 2 else self._home.down_m

    def _missing(self, state: VehicleState, there: F64, course_rad: float) -> Offset:
        """How far the vehicle is from where it is to be."""
        offset, away = self._perspective.offset, state.pos_ned_m - there
        height_m = self._ground_down_m(there) - float(state.pos_ned_m[2])
        angle_rad = wrap_rad(math.atan2(away[1], away[0]) - course_rad)
        distance_m = math.hypot(away[0], away[1])
        turn_rad = wrap_rad(offset.angle_rad - angle_rad)
        return Offset(offset.height_m - height_m, offset.distance_m - distance_m, turn_rad)

    def _course(self, state: VehicleState, target: Target, there: F64) -> float:
        north_m_s, east_m_s = target.vel_ned_m_s[:2]
        if math.hypot(north_m_s, east_m_s) > MOVING_M_S:
            self._course_rad = math.atan2(east_m_s, north_m_s)
        elif math.isnan(self._course_rad):  # never moved: the place is where the vehicle comes from
            away = state.pos_ned_m[:2] - there[:2]
            self._course_rad = math.atan2(away[1], away[0]) - self._perspective.offset.angle_rad
        return self._course_rad


def _configured(params: ParamStore) -> Offset:
    height_m, distance_m = params["FLW_TGT_HT"], params["FLW_TGT_DST"]
    return Offset(max(MIN_M, height_m), max(MIN_M, distance_m), math.radians(params["FLW_TGT_FA"]))


def _step(missing: float, quickest: float, rate: float) -> float:
    """The rate at which a stick changes something: none while the vehicle has not caught up."""
    return rate if abs(missing) < quickest * AHEAD_S else 0.0
