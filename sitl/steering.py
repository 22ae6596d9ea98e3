"""Which demand follows from what the vehicle is doing? Memory: the task being flown; time comes with the state.

Local ned; the origin is home.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import Final

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.types import F64, VehicleState
from sitl import flight_tasks
from sitl.answers import INFO, StatusText
from sitl.demand import (
    IDLE,
    AttitudeSetpoint,
    Demand,
    Loop,
    OffboardSetpoint,
    TrajectorySetpoint,
    attitude_demand,
    rates_demand,
)
from sitl.flight_tasks import FlightTask, GoTo, Land
from sitl.follow import Follow, Target
from sitl.geo import Origin
from sitl.guided_tasks import Circle, FlyTo, Goal, Orbit
from sitl.home import Home
from sitl.manual_tasks import CLIMBS, Acro, Assisted, Stabilized
from sitl.mission_flight import MissionFlight
from sitl.modes import FlightMode
from sitl.pilot import Pilot
from sitl.px4_params import ParamStore

CLIMB_MARGIN_M: Final = 0.1  # assumed: a position this far above the vehicle asks for take-off


class Behaviour(Enum):
    """What an armed vehicle does."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    RETURN = "return"
    OFFBOARD = "offboard"
    ORBIT = "orbit"
    FOLLOW = "follow"
    POSITION = "position"
    ALTITUDE = "altitude"
    STABILIZED = "stabilized"
    ACRO = "acro"
    MISSION = "mission"
    DESCEND = "descend"  # level, where the wind takes it
    CUT = "cut"  # motors off


BEHAVIOURS: Final = {
    FlightMode.HOLD: Behaviour.HOLD,
    FlightMode.TAKEOFF: Behaviour.TAKEOFF,
    FlightMode.LAND: Behaviour.LAND,
    FlightMode.RTL: Behaviour.RETURN,
    FlightMode.OFFBOARD: Behaviour.OFFBOARD,
    FlightMode.ORBIT: Behaviour.ORBIT,
    FlightMode.FOLLOW: Behaviour.FOLLOW,
    FlightMode.MISSION: Behaviour.MISSION,
    FlightMode.POSCTL: Behaviour.POSITION,
    FlightMode.POSITION_SLOW: Behaviour.POSITION,
    FlightMode.ALTCTL: Behaviour.ALTITUDE,
    FlightMode.STABILIZED: Behaviour.STABILIZED,
    FlightMode.MANUAL: Behaviour.STABILIZED,
    FlightMode.ACRO: Behaviour.ACRO,
    FlightMode.TERMINATION: Behaviour.CUT,
}
STICKS: Final = frozenset({Behaviour.POSITION, Behaviour.ALTITUDE, Behaviour.STABILIZED, Behaviour.ACRO})


class Steering:
    """Turns behaviour, state and setpoint into a demand."""

    def __init__(self, params: ParamStore) -> None:
        self.takeoff_down_m = -float(params["MIS_TAKEOFF_ALT"])
        self.home = Home(np.zeros(3), 0.0)
        self.pilot = Pilot(params)
        self.goal: Goal | None = None  # of Hold, after a reposition
        self.circle: Circle | None = None  # of Orbit
        self.target: Target | None = None  # of Follow Target
        self.cruise_m_s: float | None = None  # DO_CHANGE_SPEED; None: MPC_XY_CRUISE
        self.mission: MissionFlight | None = None
        self.safe_points_ned_m: tuple[F64, ...] = ()  # rally points: Return leads to the nearest of them and home
        self.say: Callable[[StatusText], None] = lambda _text: None
        self._params = params
        self._task: FlightTask | None = None
        self._legs: tuple[F64, ...] = ()  # of Return, still to fly
        self._yaw_rad = math.nan  # the nose that an OFFBOARD setpoint without yaw keeps
        self._setpoint: OffboardSetpoint | None = None
        self._offboard: Demand = IDLE

    def restart(self) -> None:
        """Forget the task: the next demand begins anew."""
        self._task = None
        self._legs = ()
        self._setpoint = None
        self._yaw_rad = math.nan
        self.goal = self.circle = self.cruise_m_s = None
        self.pilot.rest()

    def reposition(self, goal: Goal) -> None:
        """From now on Hold is there."""
        self.goal, self._task = goal, None

    def orbit(self, circle: Circle) -> None:
        """From now on Orbit is this circle."""
        self.circle, self._task = circle, None

    def change_speed(self, speed_m_s: float | None) -> None:
        """Fly on at another horizontal speed, until the mode changes."""
        self.cruise_m_s = speed_m_s
        if self.mission is not None:
            self.mission.set_speed(speed_m_s)
        if self.goal is not None:
            self.reposition(Goal(self.goal.pos_ned_m, self.goal.yaw_rad, speed_m_s))

    @property
    def landing(self) -> bool:
        """Is it coming down to land?"""
        return isinstance(self._task, Land)

    def climbs(self, behaviour: Behaviour, state: VehicleState, setpoint: OffboardSetpoint | None) -> bool:
        """Does a vehicle on the ground have to take off for this?"""
        if behaviour is Behaviour.OFFBOARD:
            return asks_to_climb(setpoint, state, self._params)
        if behaviour in STICKS:
            return self.pilot.present(state.t_s) and self.pilot.sticks().up > CLIMBS
        place = self.circle.centre_ned_m if behaviour is Behaviour.ORBIT and self.circle is not None else None
        if behaviour is Behaviour.HOLD and self.goal is not None:
            place = self.goal.pos_ned_m
        if place is not None:
            return bool(place[2] < state.pos_ned_m[2] - CLIMB_MARGIN_M)
        if behaviour is Behaviour.MISSION and self.mission is not None:
            return self.mission.climbs
        return behaviour is Behaviour.TAKEOFF

    def adopt(self, task: FlightTask | None) -> None:
        """Go on with this task, if there is one."""
        self._task = task

    def arrived(self, state: VehicleState) -> bool:
        """Has the climb of a take-off reached its height?"""
        return isinstance(self._task, GoTo) and self._task.done(state)

    def settle(self) -> None:
        """Hold where the way being flown ends."""
        if isinstance(self._task, GoTo):
            self._task = self._task.end()

    def demand(self, behaviour: Behaviour, state: VehicleState, setpoint: OffboardSetpoint | None) -> Demand:
        """What to ask of the control loops now; idling on the ground is the caller's decision."""
        if behaviour is Behaviour.OFFBOARD and setpoint is not None:
            return self._follow(setpoint, state)
        if behaviour is Behaviour.MISSION and self.mission is not None:
            return self.mission.demand(state)
        if self._task is None:
            self._task = self._begin(behaviour, state)
        if self._legs and self._task.done(state):
            self._task = self._next_leg(state)
        demand = self._task.demand(state)
        if isinstance(self._task, Orbit):
            self.circle = self._task.circle  # sticks may have changed it
        return demand

    def _begin(self, behaviour: Behaviour, state: VehicleState) -> FlightTask:
        params = self._params
        if behaviour is Behaviour.TAKEOFF:
            to_down_m = min(self.takeoff_down_m, float(state.pos_ned_m[2]))
            return flight_tasks.takeoff(state, to_down_m, params)
        if behaviour is Behaviour.LAND:
            return flight_tasks.land(state, params, self.home.down_m)
        if behaviour is Behaviour.RETURN:
            return self._return(state)
        if behaviour is Behaviour.DESCEND:
            return flight_tasks.Descend(yaw_rad(state.q_ned_frd), params)
        if behaviour is Behaviour.ORBIT and self.circle is not None:
            return Orbit(state, self.circle, params, self.pilot.held)
        if behaviour is Behaviour.FOLLOW:
            return Follow(state, lambda: self.target, params, self.home, self.pilot.held)
        if behaviour in STICKS:
            return self._by_hand(behaviour, state)
        return FlyTo(state, self.goal, params) if self.goal is not None else flight_tasks.hold(state)

    def _by_hand(self, behaviour: Behaviour, state: VehicleState) -> FlightTask:
        hands, params = self.pilot.sticks, self._params
        if behaviour is Behaviour.STABILIZED:
            return Stabilized(state, hands, params)
        if behaviour is Behaviour.ACRO:
            return Acro(hands, params)
        return Assisted(state, hands, params, self.home.down_m, level_hold=behaviour is Behaviour.POSITION)

    def _return(self, state: VehicleState) -> FlightTask:
        places = (self.home.pos_ned_m, *self.safe_points_ned_m)
        to = min(places, key=lambda place: float(np.hypot(*(place - state.pos_ned_m)[:2])))
        self._legs = flight_tasks.return_legs(state, self._params, to)
        down_m = float(self._legs[0][2])
        height_m, amsl_m = float(to[2]) - down_m, Origin().alt_m(down_m)
        text = f"RTL: start return at {amsl_m:.0f} m ({height_m:.0f} m above destination)"
        self.say(StatusText(INFO, text))
        return flight_tasks.leg(state, self._legs[0], self._params)

    def _next_leg(self, state: VehicleState) -> FlightTask:
        self._legs = self._legs[1:]
        if not self._legs:
            self.say(StatusText(INFO, "RTL: land at destination"))
            return flight_tasks.land(state, self._params, self.home.down_m)
        return flight_tasks.leg(state, self._legs[0], self._params)

    def _follow(self, setpoint: OffboardSetpoint, state: VehicleState) -> Demand:
        """The setpoint as a demand; made once for each setpoint."""
        if setpoint is not self._setpoint:
            self._setpoint = setpoint
            if isinstance(setpoint, AttitudeSetpoint):
                self._offboard = _direct(setpoint)
            else:
                self._offboard = self._resolve(setpoint, state)
        return self._offboard

    def _resolve(self, setpoint: TrajectorySetpoint, state: VehicleState) -> Demand:
        yaw, rate = setpoint.yaw_rad, setpoint.yaw_rate_rad_s
        if math.isfinite(yaw):
            self._yaw_rad = yaw
        elif math.isfinite(rate):
            self._yaw_rad = math.nan
        else:
            self._yaw_rad = self._yaw_rad if math.isfinite(self._yaw_rad) else yaw_rad(state.q_ned_frd)
            yaw = self._yaw_rad
        return Demand(
            Loop.POSITION,
            setpoint.pos_ned_m,
            setpoint.vel_ned_m_s,
            setpoint.acc_ned_m_s2,
            yaw,
            rate if math.isfinite(rate) else 0.0,
        )


def asks_to_climb(setpoint: OffboardSetpoint | None, state: VehicleState, params: ParamStore) -> bool:
    """Does an OFFBOARD setpoint ask a vehicle on the ground to take off? PX4's want_takeoff."""
    if setpoint is None:
        return False
    if isinstance(setpoint, AttitudeSetpoint):
        return setpoint.thrust_norm > params["MPC_THR_HOVER"]
    down_m = float(setpoint.pos_ned_m[2])
    if math.isfinite(down_m):
        return down_m < float(state.pos_ned_m[2]) - CLIMB_MARGIN_M
    down_m_s = float(setpoint.vel_ned_m_s[2])
    if math.isfinite(down_m_s):
        return down_m_s < 0.0
    return float(setpoint.acc_ned_m_s2[2]) < 0.0


def _direct(setpoint: AttitudeSetpoint) -> Demand:
    if setpoint.q_ned_frd is not None:
        return attitude_demand(setpoint.q_ned_frd, setpoint.thrust_norm)
    return rates_demand(setpoint.rates_frd_rad_s, setpoint.thrust_norm)
