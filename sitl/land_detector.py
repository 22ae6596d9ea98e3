"""Is the vehicle on the ground or in the air? PX4's land detector in short; time in, no clock.

Contact alone is a bounce: landed needs lasting contact at rest, flying needs a moment without contact.
"""

import math
from typing import Final

from companion.core.types import VehicleState

LANDED_AFTER_S: Final = 0.9  # land detector: ground contact .35 s, maybe landed .25 s, landed .3 s
FLYING_AFTER_S: Final = 0.08  # assumed: two control ticks
SPEED_XY_MAX_M_S: Final = 1.5  # LNDMC_XY_VEL_MAX
SPEED_Z_MAX_M_S: Final = 0.25  # LNDMC_Z_VEL_MAX


class LandDetector:
    """Remembers since when the vehicle has been at rest on the ground, or off it."""

    def __init__(self) -> None:
        self.landed = True
        self._since_s = math.inf  # since when the facts have spoken against ``landed``

    def update(self, state: VehicleState, contact: bool, climbing: bool, speed_known: bool = True) -> bool:
        """Judge one instant; True when ``landed`` changed.

        ``climbing``: the autopilot wants to go up. ``speed_known``: its horizontal velocity means something.
        """
        if self.landed:
            against, needed_s = not contact, FLYING_AFTER_S
        else:
            against, needed_s = contact and not climbing and _at_rest(state, speed_known), LANDED_AFTER_S
        if not against:
            self._since_s = math.inf
            return False
        self._since_s = min(self._since_s, state.t_s)
        if state.t_s - self._since_s < needed_s:
            return False
        self.landed = not self.landed
        self._since_s = math.inf
        return True


def _at_rest(state: VehicleState, speed_known: bool) -> bool:
    north_m_s, east_m_s, down_m_s = state.vel_ned_m_s.tolist()
    level = not speed_known or math.hypot(north_m_s, east_m_s) < SPEED_XY_MAX_M_S
    return level and abs(down_m_s) < SPEED_Z_MAX_M_S
