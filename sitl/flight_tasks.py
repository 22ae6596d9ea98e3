"""Where should the vehicle be right now in Hold, Takeoff, Land and Return? Pure functions of time; local ned.

A task is made when its mode begins to steer and is asked for a demand at every control tick.
"""

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.types import F64, VehicleState
from sitl.demand import Demand, position_demand
from sitl.px4_params import ParamStore

RAMP_ACC_M_S2: Final = 2.0  # assumed: gentler than PX4's MPC_ACC_HOR 3 and MPC_ACC_UP_MAX 4
BRAKE_ACC_M_S2: Final = 3.0  # MPC_ACC_HOR
BRAKE_DELAY_S: Final = 0.6  # navigator: 0.6 * MPC_JERK_AUTO / MPC_JERK_AUTO
ARRIVED_M: Final = 0.1
ARRIVED_M_S: Final = 0.3
RTL_NEAR_M: Final = 5.0  # RTL_MIN_DIST: nearer than this, no climb


class FlightTask(Protocol):
    """What steers in one flight mode."""

    def demand(self, state: VehicleState) -> Demand:
        """What to ask of the control loops now."""
        ...

    def done(self, state: VehicleState) -> bool:
        """Has the task reached its end?"""
        ...


@dataclass(frozen=True, slots=True)
class Ramp:
    """A straight way flown with a trapezoidal speed profile."""

    t_s: float
    from_ned_m: F64  # (3,)
    to_ned_m: F64  # (3,)
    speed_m_s: float

    def at(self, t_s: float) -> tuple[F64, F64]:
        """Position and velocity (3,) at ``t_s``."""
        way = self.to_ned_m - self.from_ned_m
        length_m = float(np.linalg.norm(way))
        if length_m == 0.0:
            return self.to_ned_m, np.zeros(3)
        along_m, speed_m_s = trapezoid(t_s - self.t_s, length_m, self.speed_m_s, RAMP_ACC_M_S2)
        return self.from_ned_m + way * (along_m / length_m), way * (speed_m_s / length_m)


@dataclass(frozen=True, slots=True)
class Hold:
    """Stay at one place."""

    place: Demand

    def demand(self, state: VehicleState) -> Demand:
        """The place, always the same object."""
        return self.place

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False


@dataclass(frozen=True, slots=True)
class GoTo:
    """Fly a straight way, nose fixed, and be done when there."""

    ramp: Ramp
    yaw_rad: float

    def demand(self, state: VehicleState) -> Demand:
        """The point of the way that belongs to this instant, with its velocity fed forward."""
        pos, vel = self.ramp.at(state.t_s)
        return position_demand(pos, self.yaw_rad, vel)

    def done(self, state: VehicleState) -> bool:
        """At the end of the way and nearly at rest."""
        near = bool(np.linalg.norm(state.pos_ned_m - self.ramp.to_ned_m) < ARRIVED_M)
        return near and bool(np.linalg.norm(state.vel_ned_m_s) < ARRIVED_M_S)

    def end(self) -> Hold:
        """Hold where the way ends."""
        return Hold(position_demand(self.ramp.to_ned_m, self.yaw_rad))


@dataclass(frozen=True, slots=True)
class Land:
    """Come down over one place."""

    north_m: float
    east_m: float
    yaw_rad: float
    params: ParamStore
    home_down_m: float = 0.0

    def demand(self, state: VehicleState) -> Demand:
        """The place, and a descent that slows down near the ground (height above home)."""
        height_m = self.home_down_m - float(state.pos_ned_m[2])
        speed_m_s = descent_m_s(height_m, self.params, self.params["MPC_Z_V_AUTO_DN"])
        return position_demand(
            np.array([self.north_m, self.east_m, math.nan]),
            self.yaw_rad,
            np.array([math.nan, math.nan, speed_m_s]),
        )

    def done(self, state: VehicleState) -> bool:
        """Never: landing ends with the land detector."""
        return False


@dataclass(frozen=True, slots=True)
class Descend:
    """Come down level, without knowing where."""

    yaw_rad: float
    params: ParamStore

    def demand(self, state: VehicleState) -> Demand:
        """No tilt, and the speed of a landing."""
        speed_m_s = float(self.params["MPC_LAND_SPEED"])
        nowhere, level = np.full(3, math.nan), np.array([0.0, 0.0, math.nan])
        return position_demand(nowhere, self.yaw_rad, np.array([math.nan, math.nan, speed_m_s]), level)

    def done(self, state: VehicleState) -> bool:
        """Never: it ends with the land detector."""
        return False


def trapezoid(t_s: float, length_m: float, speed_m_s: float, acc_m_s2: float) -> tuple[float, float]:
    """Distance and speed after ``t_s`` of a way from rest to rest."""
    peak_m_s = min(speed_m_s, math.sqrt(length_m * acc_m_s2))
    ramp_s = peak_m_s / acc_m_s2
    total_s = length_m / peak_m_s + ramp_s
    if t_s <= 0.0:
        return 0.0, 0.0
    if t_s >= total_s:
        return length_m, 0.0
    if t_s < ramp_s:
        return acc_m_s2 * t_s**2 / 2, acc_m_s2 * t_s
    if t_s > total_s - ramp_s:
        left_s = total_s - t_s
        return length_m - acc_m_s2 * left_s**2 / 2, acc_m_s2 * left_s
    return peak_m_s * (t_s - ramp_s / 2), peak_m_s


def stopping_point(state: VehicleState) -> F64:
    """Where PX4's navigator expects to stand after braking from here (preproject_stop_point); altitude kept."""
    pos = state.pos_ned_m.copy()
    speed_m_s = math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
    pos[:2] += state.vel_ned_m_s[:2] * (speed_m_s / (2 * BRAKE_ACC_M_S2) + BRAKE_DELAY_S)
    return pos


def hold(state: VehicleState) -> Hold:
    """Brake and stay."""
    return Hold(position_demand(stopping_point(state), yaw_rad(state.q_ned_frd)))


def takeoff(state: VehicleState, to_down_m: float, params: ParamStore) -> GoTo:
    """Climb straight up to ``to_down_m``."""
    to = np.array([state.pos_ned_m[0], state.pos_ned_m[1], to_down_m])
    ramp = Ramp(state.t_s, state.pos_ned_m, to, params["MPC_TKO_SPEED"])
    return GoTo(ramp, yaw_rad(state.q_ned_frd))


def land(state: VehicleState, params: ParamStore, home_down_m: float = 0.0) -> Land:
    """Brake and come down."""
    north_m, east_m, _ = stopping_point(state).tolist()
    return Land(north_m, east_m, yaw_rad(state.q_ned_frd), params, home_down_m)


def descent_m_s(height_m: float, params: ParamStore, fast_m_s: float) -> float:
    """How fast to come down at a height above home: ``fast_m_s`` high up, MPC_LAND_SPEED near the ground."""
    slow_m_s, high_m, low_m = params["MPC_LAND_SPEED"], params["MPC_LAND_ALT1"], params["MPC_LAND_ALT2"]
    share = (height_m - low_m) / max(high_m - low_m, 1e-3)
    return slow_m_s + min(max(share, 0.0), 1.0) * (fast_m_s - slow_m_s)


def return_legs(state: VehicleState, params: ParamStore, home_ned_m: F64) -> tuple[F64, ...]:
    """Way points (3,) of Return to home: up, then across. Near home the climb is left out."""
    here = stopping_point(state)
    distance_m = math.hypot(*(here - home_ned_m)[:2])
    # PX4's cone of 45 degrees: no higher than twice the distance still to go.
    height_m = min(float(params["RTL_RETURN_ALT"]), 2.0 * distance_m) if distance_m > RTL_NEAR_M else 0.0
    down_m = min(float(here[2]), float(home_ned_m[2]) - height_m)
    return np.array([here[0], here[1], down_m]), np.array([home_ned_m[0], home_ned_m[1], down_m])


def leg(state: VehicleState, to_ned_m: F64, params: ParamStore) -> GoTo:
    """One leg of Return."""
    level = abs(float(to_ned_m[2] - state.pos_ned_m[2])) < 1.0
    speed_m_s = params["MPC_XY_CRUISE"] if level else params["MPC_Z_V_AUTO_UP"]
    return GoTo(Ramp(state.t_s, state.pos_ned_m, to_ned_m, speed_m_s), yaw_rad(state.q_ned_frd))
