"""Which of PX4's parameters does this vehicle honour, and what are they set to?

Names, types and defaults are PX4's (v1.16, multicopter). Only parameters that change what the vehicle does are here;
those of the control loops (MPC_*, MC_*) come from the aircraft model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from companion.core.params import nearest


@dataclass(frozen=True, slots=True)
class Px4Param:
    """One parameter; the type of ``default`` is its type on the wire (int: INT32, float: REAL32)."""

    default: int | float
    unit: str
    text: str


PARAMS: Mapping[str, Px4Param] = {
    "COM_DISARM_LAND": Px4Param(2.0, "s", "disarm this long after landing; not above 0: never"),
    "COM_DISARM_PRFLT": Px4Param(10.0, "s", "disarm this long after arming without take-off; not above 0: never"),
    "COM_OBL_RC_ACT": Px4Param(
        0,
        "",
        "on loss of the OFFBOARD stream: 0 Position, 1 Altitude, 2 Stabilized (all three descend and land without"
        " sticks), 3 Return, 4 Land, 5 Hold, 6 Terminate, 7 Disarm",
    ),
    "COM_OF_LOSS_T": Px4Param(1.0, "s", "a setpoint stream older than this is lost"),
    "COM_SPOOLUP_TIME": Px4Param(1.0, "s", "motors idle this long between arming and climbing"),
    "MIS_TAKEOFF_ALT": Px4Param(2.5, "m", "default height of a take-off above where it starts"),
    "MPC_LAND_ALT1": Px4Param(10.0, "m", "height above home below which a descent slows down"),
    "MPC_LAND_ALT2": Px4Param(5.0, "m", "height above home below which a descent goes at MPC_LAND_SPEED"),
    "MPC_LAND_SPEED": Px4Param(0.7, "m/s", "descent speed near the ground"),
    "MPC_TKO_SPEED": Px4Param(1.5, "m/s", "climb speed of a take-off"),
    "MPC_XY_CRUISE": Px4Param(5.0, "m/s", "horizontal speed of Return"),
    "MPC_Z_V_AUTO_DN": Px4Param(1.5, "m/s", "descent speed above MPC_LAND_ALT1"),
    "MPC_Z_V_AUTO_UP": Px4Param(3.0, "m/s", "climb speed of Return"),
    "RTL_RETURN_ALT": Px4Param(30.0, "m", "height above home of Return; lower near home"),
}


class ParamStore:
    """Current values by name: the autopilot's own, and those of the control loops (``loops``: name to value)."""

    def __init__(self, overrides: Mapping[str, float] | None = None, loops: Mapping[str, float] | None = None) -> None:
        self._values: dict[str, int | float] = {name: info.default for name, info in PARAMS.items()}
        self._values.update(loops or {})
        for name, value in (overrides or {}).items():
            self.set(name, value)

    def __getitem__(self, name: str) -> int | float:
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def names(self) -> list[str]:
        """Every name, in the order of the parameter index."""
        return sorted(self._values)

    def set(self, name: str, value: int | float) -> None:
        """Change one value. Raises KeyError for an unknown name, ValueError for a value that is not finite."""
        if name not in self._values:
            raise KeyError(f"unknown PX4 parameter '{name}'{nearest(name, self.names())}")
        if not math.isfinite(value):
            raise ValueError(f"PX4 parameter '{name}' = {value} is not finite")
        self._values[name] = type(self._values[name])(value)
