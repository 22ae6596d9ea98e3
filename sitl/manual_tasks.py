"""Where do the sticks send the vehicle? Position, Altitude, Stabilized and Acro as PX4 flies them; local ned.

Tasks with memory: made when the mode begins to steer, asked for a demand at every control tick.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from companion.core.frames import quaternion, rotation_ned_frd, wrap_rad, yaw_rad
from companion.core.types import F64, VehicleState
from sitl.aircraft import GRAVITY_M_S2
from sitl.demand import Demand, Loop, attitude_demand, rates_demand
from sitl.flight_tasks import descent_m_s
from sitl.pilot import Sticks, expo
from sitl.px4_params import ParamStore

ACRO_EXPO: Final = 0.69  # MC_ACRO_EXPO
CLIMBS: Final = 0.3  # assumed: throttle this far above the middle leaves the ground

Hands = Callable[[], Sticks]


class Climb:
    """Height by the throttle: climb rate, or height kept where the throttle was let go."""

    def __init__(self, state: VehicleState, params: ParamStore, home_down_m: float) -> None:
        self._params = params
        self._home_down_m = home_down_m
        self._rate_m_s = float(state.vel_ned_m_s[2])
        self._lock_m = math.nan
        self._t_s = state.t_s

    def move(self, state: VehicleState, up: float) -> tuple[float, float]:
        """Position (NaN: free) and velocity along down."""
        params = self._params
        dt_s, self._t_s = state.t_s - self._t_s, state.t_s
        stick = expo(up, params["MPC_Z_MAN_EXPO"], params["MPC_HOLD_DZ"])
        down_m = float(state.pos_ned_m[2])
        if stick >= 0.0:
            wanted_m_s = -stick * params["MPC_Z_VEL_MAX_UP"]
        else:
            wanted_m_s = -stick * min(
                params["MPC_Z_VEL_MAX_DN"], descent_m_s(self._home_down_m - down_m, params, params["MPC_Z_VEL_MAX_DN"])
            )
        most = params["MPC_ACC_UP_MAX" if wanted_m_s < self._rate_m_s else "MPC_ACC_DOWN_MAX"] * dt_s
        self._rate_m_s += min(max(wanted_m_s - self._rate_m_s, -most), most)
        still = stick == 0.0 and abs(float(state.vel_ned_m_s[2])) < params["MPC_HOLD_MAX_Z"]
        if stick != 0.0:
            self._lock_m = math.nan
        elif still and math.isnan(self._lock_m):
            self._lock_m, self._rate_m_s = down_m, 0.0
        return self._lock_m, self._rate_m_s


class Turn:
    """Heading by the yaw stick: a rate, or the heading kept where the stick was let go."""

    def __init__(self, state: VehicleState, params: ParamStore) -> None:
        self._params = params
        self._lock_rad = yaw_rad(state.q_ned_frd)

    def move(self, state: VehicleState, turn: float) -> tuple[float, float]:
        """Heading (NaN: free) and its rate."""
        stick = expo(turn, self._params["MPC_YAW_EXPO"], self._params["MPC_HOLD_DZ"])
        if stick == 0.0:
            if math.isnan(self._lock_rad):
                self._lock_rad = yaw_rad(state.q_ned_frd)
            return self._lock_rad, 0.0
        self._lock_rad = math.nan
        return math.nan, stick * math.radians(self._params["MPC_MAN_Y_MAX"])


class Assisted:
    """Position and Altitude: sticks are speeds, or (``level_hold`` False) tilt instead of horizontal speed."""

    def __init__(
        self, state: VehicleState, hands: Hands, params: ParamStore, home_down_m: float, level_hold: bool
    ) -> None:
        self._hands = hands
        self._params = params
        self._level_hold = level_hold
        self._climb = Climb(state, params, home_down_m)
        self._turn = Turn(state, params)
        self._vel_m_s: F64 = state.vel_ned_m_s[:2].copy()
        self._lock_m: F64 = np.full(2, math.nan)
        self._t_s = state.t_s

    def demand(self, state: VehicleState) -> Demand:
        """What the sticks ask for now."""
        sticks = self._hands()
        dt_s, self._t_s = state.t_s - self._t_s, state.t_s
        down_m, down_m_s = self._climb.move(state, sticks.up)
        heading_rad, rate_rad_s = self._turn.move(state, sticks.turn)
        level = _level(sticks, self._params, yaw_rad(state.q_ned_frd))
        pos, vel, acc = np.full(3, math.nan), np.full(3, math.nan), np.full(3, math.nan)
        pos[2], vel[2] = down_m, down_m_s
        if self._level_hold:
            self._run(state, level * self._params["MPC_VEL_MANUAL"], dt_s)
            pos[:2], vel[:2] = self._lock_m, self._vel_m_s
        else:
            acc[:2] = level * GRAVITY_M_S2 * math.tan(math.radians(self._params["MPC_MAN_TILT_MAX"]))
        return Demand(Loop.POSITION, pos, vel, acc, heading_rad, rate_rad_s)

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False

    def _run(self, state: VehicleState, wanted_m_s: F64, dt_s: float) -> None:
        """Horizontal speed with limited acceleration; the place is locked once the vehicle stands."""
        change = wanted_m_s - self._vel_m_s
        size = float(np.linalg.norm(change))
        self._vel_m_s = self._vel_m_s + change * min(1.0, self._params["MPC_ACC_HOR"] * dt_s / max(size, 1e-9))
        if wanted_m_s.any():
            self._lock_m = np.full(2, math.nan)
        elif math.isnan(self._lock_m[0]) and _speed_m_s(state) < self._params["MPC_HOLD_MAX_XY"]:
            self._lock_m, self._vel_m_s = state.pos_ned_m[:2].copy(), np.zeros(2)


class Stabilized:
    """Stabilized and Manual: sticks are tilt, yaw rate and thrust."""

    def __init__(self, state: VehicleState, hands: Hands, params: ParamStore) -> None:
        self._hands = hands
        self._params = params
        self._yaw_rad = yaw_rad(state.q_ned_frd)
        self._t_s = state.t_s

    def demand(self, state: VehicleState) -> Demand:
        """What the sticks ask for now."""
        sticks, params = self._hands(), self._params
        dt_s, self._t_s = state.t_s - self._t_s, state.t_s
        turn = expo(sticks.turn, params["MPC_YAW_EXPO"], params["MPC_HOLD_DZ"])
        self._yaw_rad = wrap_rad(self._yaw_rad + turn * math.radians(params["MPC_MAN_Y_MAX"]) * dt_s)
        tilt_rad = math.radians(params["MPC_MAN_TILT_MAX"])
        right, forward = sticks.right * tilt_rad, sticks.forward * tilt_rad
        size = math.hypot(right, forward)
        share = min(1.0, tilt_rad / size) if size > 0.0 else 1.0
        return attitude_demand(
            quaternion(right * share, -forward * share, self._yaw_rad), throttle_norm(sticks.up, params)
        )

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False


class Acro:
    """Acro: sticks are body rates and thrust."""

    def __init__(self, hands: Hands, params: ParamStore) -> None:
        self._hands = hands
        self._params = params

    def demand(self, state: VehicleState) -> Demand:
        """What the sticks ask for now."""
        sticks = self._hands()
        axes = (("R", sticks.right), ("P", -sticks.forward), ("Y", sticks.turn))
        rates = [expo(s, ACRO_EXPO, 0.0) * math.radians(self._params[f"MC_ACRO_{name}_MAX"]) for name, s in axes]
        return rates_demand(np.array(rates), throttle_norm(sticks.up, self._params))

    def done(self, state: VehicleState) -> bool:
        """Never."""
        return False


def throttle_norm(up: float, params: ParamStore) -> float:
    """Thrust of a throttle stick: MPC_THR_HOVER in the middle (MPC_THR_CURVE 0)."""
    low, hover, full = params["MPC_MANTHR_MIN"], params["MPC_THR_HOVER"], params["MPC_THR_MAX"]
    up = min(1.0, max(-1.0, up))
    return hover + up * (full - hover) if up > 0.0 else hover + up * (hover - low)


def _level(sticks: Sticks, params: ParamStore, heading_rad: float) -> F64:
    """Horizontal stick (2,) in ned, no longer than 1."""
    curve, dead_zone = params["MPC_XY_MAN_EXPO"], params["MPC_HOLD_DZ"]
    forward, right = expo(sticks.forward, curve, dead_zone), expo(sticks.right, curve, dead_zone)
    size = max(1.0, math.hypot(forward, right))
    turn = rotation_ned_frd(quaternion(0.0, 0.0, heading_rad))[:2, :2]
    level: F64 = turn @ np.array([forward / size, right / size])
    return level


def _speed_m_s(state: VehicleState) -> float:
    return math.hypot(state.vel_ned_m_s[0], state.vel_ned_m_s[1])
