"""Where is home, and who put it there? A value; local ned."""

from dataclasses import dataclass

from companion.core.frames import yaw_rad
from companion.core.types import F64, VehicleState


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """Where Return leads and what heights "above home" are counted from."""

    pos_ned_m: F64  # (3,)
    yaw_rad: float
    manual: bool = False  # set by command: arming does not move it

    @property
    def down_m(self) -> float:
        """Local height of home, positive down."""
        return float(self.pos_ned_m[2])


def here(state: VehicleState) -> Home:
    """Home where the vehicle stands."""
    return Home(state.pos_ned_m, yaw_rad(state.q_ned_frd))
