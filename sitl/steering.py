"""Which demand follows from what the vehicle is doing? Memory: the task being flown; time comes with the state.

Local ned; the origin is home.
"""

import math
from enum import Enum
from typing import Final

from companion.core.frames import yaw_rad
from companion.core.types import F64, VehicleState
from sitl import flight_tasks
from sitl.demand import IDLE, Demand, Loop, TrajectorySetpoint
from sitl.flight_tasks import FlightTask, GoTo
from sitl.px4_params import ParamStore

CLIMB_MARGIN_M: Final = 0.1  # assumed: an OFFBOARD position this far above the vehicle asks for take-off


class Behaviour(Enum):
    """What an armed vehicle does."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    RETURN = "return"
    OFFBOARD = "offboard"
    CUT = "cut"  # motors off


class Steering:
    """Turns behaviour, state and setpoint into a demand."""

    def __init__(self, params: ParamStore) -> None:
        self.takeoff_down_m = -float(params["MIS_TAKEOFF_ALT"])
        self._params = params
        self._task: FlightTask | None = None
        self._legs: tuple[F64, ...] = ()  # of Return, still to fly
        self._yaw_rad = math.nan  # the nose that an OFFBOARD setpoint without yaw keeps
        self._setpoint: TrajectorySetpoint | None = None
        self._offboard: Demand = IDLE

    def restart(self) -> None:
        """Forget the task: the next demand begins anew."""
        self._task = None
        self._legs = ()
        self._setpoint = None
        self._yaw_rad = math.nan

    def arrived(self, state: VehicleState) -> bool:
        """Has the climb of a take-off reached its height?"""
        return isinstance(self._task, GoTo) and self._task.done(state)

    def settle(self) -> None:
        """Hold where the way being flown ends."""
        if isinstance(self._task, GoTo):
            self._task = self._task.end()

    def demand(self, behaviour: Behaviour, state: VehicleState, setpoint: TrajectorySetpoint | None) -> Demand:
        """What to ask of the control loops now; idling on the ground is the caller's decision."""
        if behaviour is Behaviour.OFFBOARD and setpoint is not None:
            return self._follow(setpoint, state)
        if self._task is None:
            self._task = self._begin(behaviour, state)
        if self._legs and self._task.done(state):
            self._task = self._next_leg(state)
        return self._task.demand(state)

    def _begin(self, behaviour: Behaviour, state: VehicleState) -> FlightTask:
        if behaviour is Behaviour.TAKEOFF:
            to_down_m = min(self.takeoff_down_m, float(state.pos_ned_m[2]))
            return flight_tasks.takeoff(state, to_down_m, self._params)
        if behaviour is Behaviour.LAND:
            return flight_tasks.land(state, self._params)
        if behaviour is Behaviour.RETURN:
            self._legs = flight_tasks.return_legs(state, self._params)
            return flight_tasks.leg(state, self._legs[0], self._params)
        return flight_tasks.hold(state)

    def _next_leg(self, state: VehicleState) -> FlightTask:
        self._legs = self._legs[1:]
        if not self._legs:
            return flight_tasks.land(state, self._params)
        return flight_tasks.leg(state, self._legs[0], self._params)

    def _follow(self, setpoint: TrajectorySetpoint, state: VehicleState) -> Demand:
        """The setpoint as a demand; made once for each setpoint."""
        if setpoint is not self._setpoint:
            self._setpoint = setpoint
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


def asks_to_climb(setpoint: TrajectorySetpoint | None, state: VehicleState) -> bool:
    """Does an OFFBOARD setpoint ask a vehicle on the ground to take off? PX4's want_takeoff."""
    if setpoint is None:
        return False
    down_m = float(setpoint.pos_ned_m[2])
    if math.isfinite(down_m):
        return down_m < float(state.pos_ned_m[2]) - CLIMB_MARGIN_M
    down_m_s = float(setpoint.vel_ned_m_s[2])
    if math.isfinite(down_m_s):
        return down_m_s < 0.0
    return float(setpoint.acc_ned_m_s2[2]) < 0.0
