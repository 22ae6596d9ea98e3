"""What does the OFFBOARD client ask for, and is it still there? Time comes with every call."""

import math

from sitl.demand import AttitudeSetpoint, OffboardSetpoint
from sitl.px4_params import ParamStore


class OffboardStream:
    """Remembers the newest setpoint and when one was heard."""

    def __init__(self, params: ParamStore) -> None:
        self.setpoint: OffboardSetpoint | None = None  # in force
        self._params = params
        self._heard_s = -math.inf

    def fresh(self, t_s: float) -> bool:
        """Was a setpoint of any kind heard within COM_OF_LOSS_T?"""
        return t_s - self._heard_s <= self._params["COM_OF_LOSS_T"]

    def hear(self, t_s: float) -> None:
        """A setpoint arrived: proof of life, in any mode."""
        if not self.fresh(t_s):
            self.setpoint = None  # of an older stream
        self._heard_s = max(self._heard_s, t_s)

    @property
    def needs_position(self) -> bool:
        """Can it not be flown without an estimate of the position?"""
        return not isinstance(self.setpoint, AttitudeSetpoint)
