"""Which of PX4's parameters does this vehicle honour, and what are they set to?

The names stand in ``px4_param_table``; those of the control loops (MPC_*, MC_*) come from the aircraft model.
"""

import math
from collections.abc import Mapping

from companion.core.params import nearest
from sitl.px4_param_table import PARAMS, Px4Param

__all__ = ["PARAMS", "ParamStore", "Px4Param"]


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
