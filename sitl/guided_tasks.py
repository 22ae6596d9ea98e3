"""Where should the vehicle be right now in Reposition and Orbit? Local ned.

Tasks with memory: made when the mode begins to steer, asked for a demand at every control tick.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

import numpy as np

from companion.core.frames import wrap_rad, yaw_rad
from companion.core.types import F64, VehicleState
from sitl.chaser import Chaser, Pace
from sitl.demand import Demand, position_demand
from sitl.pilot import Sticks, expo
from sitl.px4_params import ParamStore

RADIUS_MIN_M: Final = 1.0  # FlightTaskOrbit: _radius_min
SPEED_MAX_M_S: Final = 10.0  # FlightTaskOrbit: _velocity_max
ACC_MAX_M_S2: Final = 2.0  # FlightTaskOrbit: _acceleration_max
ON_CIRCLE_M: Final = 0.5  # assumed: nearer than this, the round begins


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """A place to fly to and stay at."""

    pos_ned_m: F64  # (3,)
    yaw_rad: float  # NaN: as it is
    speed_m_s: float | None = None  # None: MPC_XY_CRUISE


class Nose(IntEnum):
    """ORBIT_YAW_BEHAVIOUR."""

    CENTRE = 0
    INITIAL = 1
    FREE = 2
    TANGENT = 3
    STICKS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Circle:
    """An orbit."""

    centre_ned_m: F64  # (3,) its height is the orbit's
    radius_m: float
    speed_m_s: float  # positive clockwise
    nose: int


def auto_pace(params: ParamStore, speed_m_s: float | None = None) -> Pace:
    """PX4's speeds of its autonomous modes."""
    level_m_s = min(speed_m_s or params["MPC_XY_CRUISE"], params["MPC_XY_VEL_MAX"])
    return Pace(level_m_s, params["MPC_Z_V_AUTO_UP"], params["MPC_Z_V_AUTO_DN"])


class FlyTo:
    """Fly to a goal and stay there."""

    def __init__(self, state: VehicleState, goal: Goal, params: ParamStore) -> None:
        self.goal = goal
        self._chaser = Chaser(state)
        self._pace = auto_pace(params, goal.speed_m_s)

    def demand(self, state: VehicleState) -> Demand:
        """The point that runs ahead."""
        return self._chaser.run(state.t_s, self.goal.pos_ned_m, self._pace, self.goal.yaw_rad)

    def done(self, state: VehicleState) -> bool:
        """Never: it stays."""
        return False


class Orbit:
    """Fly straight to the circle, then round it; sticks make it larger or smaller, quicker or slower."""

    def __init__(
        self, state: VehicleState, circle: Circle, params: ParamStore, hands: Callable[[float], Sticks]
    ) -> None:
        """``hands``: the sticks at a time, centred where there are none."""
        self.circle = circle
        self._hands = hands
        self._params = params
        self._chaser = Chaser(state)
        self._initial_rad = yaw_rad(state.q_ned_frd)
        self._bearing_rad = math.nan  # from the centre, once on the circle
        self._speed_m_s = 0.0
        self._t_s = state.t_s

    def demand(self, state: VehicleState) -> Demand:
        """A point of the way to the circle, or of the circle."""
        dt_s, self._t_s = state.t_s - self._t_s, state.t_s
        self.circle = by_sticks(self.circle, self._hands(state.t_s), dt_s, self._params)
        if math.isnan(self._bearing_rad):
            return self._approach(state)
        return self._round(dt_s)

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False

    def _approach(self, state: VehicleState) -> Demand:
        centre = self.circle.centre_ned_m
        away = state.pos_ned_m[:2] - centre[:2]
        bearing_rad = math.atan2(away[1], away[0])
        nearest = on_circle(centre, self.circle.radius_m, bearing_rad)
        if float(np.linalg.norm(state.pos_ned_m - nearest)) < ON_CIRCLE_M:
            self._bearing_rad = bearing_rad
            return self._round(0.0)
        return self._chaser.run(state.t_s, nearest, auto_pace(self._params), wrap_rad(bearing_rad + math.pi))

    def _round(self, dt_s: float) -> Demand:
        circle, chaser = self.circle, self._chaser
        most = self._params["MPC_ACC_HOR"] * dt_s
        self._speed_m_s += min(max(circle.speed_m_s - self._speed_m_s, -most), most)
        turn_rad_s = self._speed_m_s / circle.radius_m
        self._bearing_rad = wrap_rad(self._bearing_rad + turn_rad_s * dt_s)
        bearing = self._bearing_rad
        out = np.array([math.cos(bearing), math.sin(bearing), 0.0])
        along = np.array([-out[1], out[0], 0.0])
        chaser.run(self._t_s, chaser.pos_ned_m, auto_pace(self._params), self._nose_rad())
        return position_demand(
            on_circle(circle.centre_ned_m, circle.radius_m, bearing),
            chaser.yaw_rad,
            along * self._speed_m_s,
            out * (-(self._speed_m_s**2) / circle.radius_m),
        )

    def _nose_rad(self) -> float:
        nose = self.circle.nose
        if nose == Nose.TANGENT:
            return wrap_rad(self._bearing_rad + math.copysign(math.pi / 2, self.circle.speed_m_s))
        if nose == Nose.CENTRE:
            return wrap_rad(self._bearing_rad + math.pi)
        return self._initial_rad


def by_sticks(circle: Circle, sticks: Sticks, dt_s: float, params: ParamStore) -> Circle:
    """FlightTaskOrbit: along its nose the vehicle changes the radius, across the nose the speed."""
    curve, dead_zone = params["MPC_XY_MAN_EXPO"], params["MPC_HOLD_DZ"]
    inwards, left = expo(sticks.forward, curve, dead_zone), -expo(sticks.right, curve, dead_zone)
    if not inwards and not left:
        return circle
    if circle.nose == Nose.TANGENT:  # clockwise, the centre is to its right
        sign = math.copysign(1.0, circle.speed_m_s)
        inwards, left = -left * sign, inwards * sign
    radius_m = circle.radius_m - inwards * params["MPC_XY_CRUISE"] * dt_s
    radius_m = min(max(radius_m, RADIUS_MIN_M), params["MC_ORBIT_RAD_MAX"])
    speed_m_s = circle.speed_m_s + left * params["MPC_ACC_HOR"] * dt_s
    return replace(circle, radius_m=radius_m, speed_m_s=circle_speed_m_s(radius_m, speed_m_s))


def circle_speed_m_s(radius_m: float, speed_m_s: float) -> float:
    """The speed that PX4 allows on a circle; the sign stays."""
    most = min(SPEED_MAX_M_S, math.sqrt(ACC_MAX_M_S2 * radius_m))
    return min(max(speed_m_s, -most), most)


def on_circle(centre_ned_m: F64, radius_m: float, bearing_rad: float) -> F64:
    """The point of a circle in a direction from its centre."""
    offset = np.array([math.cos(bearing_rad), math.sin(bearing_rad), 0.0])
    return centre_ned_m + radius_m * offset
