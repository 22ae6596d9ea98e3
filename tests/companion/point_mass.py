"""How does a vehicle with PX4's default gains answer setpoints? A plane point mass with tilt lag; for tests."""

import math

import numpy as np

from companion.core.types import F64, Setpoint, VehicleState

DT_S = 0.004
STEPS_PER_TICK = 10  # 25 Hz
LATE_S = 0.05  # a setpoint takes effect this long after its scan
POSITION_P, VELOCITY_P, VELOCITY_I = 0.95, 1.8, 0.4  # MPC_XY_P, MPC_XY_VEL_P_ACC, MPC_XY_VEL_I_ACC
ACC_MAX_M_S2 = 6.87  # 35 deg of tilt
DOWN_M = -3.0


class PointMass:
    def __init__(
        self, pos: tuple[float, float] = (0.0, 0.0), vel: tuple[float, float] = (0.0, 0.0), lag_s: float = 0.12
    ) -> None:
        self.t_s = 0.0
        self.pos = np.array(pos, dtype=np.float64)
        self.vel = np.array(vel, dtype=np.float64)
        self._lag_s = lag_s
        self._acc = np.zeros(2)
        self._integral = np.zeros(2)
        self._active: Setpoint | None = None
        self._queue: list[Setpoint] = []

    def state(self) -> VehicleState:
        return VehicleState(
            self.t_s,
            np.array([*self.pos, DOWN_M]),
            np.array([*self.vel, 0.0]),
            np.array([1.0, 0.0, 0.0, 0.0]),
            np.zeros(3),
        )

    def tick(self, setpoint: Setpoint | None) -> None:
        if setpoint is not None:
            self._queue.append(setpoint)
        for _ in range(STEPS_PER_TICK):
            while self._queue and self.t_s >= self._queue[0].t_s + LATE_S - 1e-9:
                self._active = self._queue.pop(0)
            self._step(self._wanted())

    def _wanted(self) -> F64:
        if self._active is None:
            return np.zeros(2)
        pos, vel, acc = self._active.pos_ned_m, self._active.vel_ned_m_s, self._active.acc_ned_m_s2
        assert pos is not None and vel is not None and acc is not None
        error = POSITION_P * (pos[:2] - self.pos) + vel[:2] - self.vel
        wanted: F64 = VELOCITY_P * error + self._integral + acc[:2]
        size = math.hypot(*wanted)
        if size > ACC_MAX_M_S2:
            return wanted * (ACC_MAX_M_S2 / size)
        self._integral += VELOCITY_I * error * DT_S
        return wanted

    def _step(self, wanted: F64) -> None:
        self._acc += (wanted - self._acc) * DT_S / self._lag_s
        self.vel += self._acc * DT_S
        self.pos += self.vel * DT_S
        self.t_s += DT_S
