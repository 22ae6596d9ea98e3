"""What does a mission ask for at each index? Places, speeds, jumps; pure but for the jumps already made; local ned."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.types import F64
from sitl.geo import Origin
from sitl.home import Home
from sitl.mission_check import down_m
from sitl.mission_items import MissionItem
from sitl.px4_params import ParamStore

JUMPS_MAX: Final = 10  # a chain of jumps longer than this goes nowhere (PX4's limit)
LANDS: Final = frozenset({mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_NAV_VTOL_LAND})
TAKES_OFF: Final = frozenset({mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_VTOL_TAKEOFF})
_TIMED: Final = frozenset({mav.MAV_CMD_NAV_WAYPOINT, mav.MAV_CMD_NAV_LOITER_TIME})
_DELAYS: Final = frozenset({mav.MAV_CMD_NAV_DELAY, mav.MAV_CMD_CONDITION_DELAY})
_WITH_YAW: Final = frozenset({mav.MAV_CMD_NAV_WAYPOINT, mav.MAV_CMD_NAV_LOITER_UNLIM, mav.MAV_CMD_NAV_LOITER_TIME})
_GROUND_SPEEDS: Final = (0.0, 1.0)  # SPEED_TYPE air and ground: the same to a multicopter


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """One place to fly to."""

    ned_m: F64  # (3,)
    radius_m: float  # acceptance
    hold_s: float  # stay this long; inf: for good
    yaw_rad: float  # NaN: along the way


class Route:
    """The items of a mission, with the jumps made so far."""

    def __init__(
        self, items: Sequence[MissionItem], origin: Origin, home: Callable[[], Home], params: ParamStore
    ) -> None:
        self.items = tuple(items)
        self._home = home
        self._origin = origin
        self._params = params
        self._jumped = [0] * len(self.items)

    def forget_jumps(self) -> None:
        """As if the mission had not been flown yet."""
        self._jumped = [0] * len(self.items)

    def resolve(self, index: int, count: bool = True) -> int | None:
        """The index at which execution goes on, jumps followed (and counted); None: past the end."""
        for _ in range(JUMPS_MAX):
            if not 0 <= index < len(self.items):
                return None
            item = self.items[index]
            if item.command != mav.MAV_CMD_DO_JUMP:
                return index
            target, repeats = _whole(item.params[0]), _whole(item.params[1])
            if self._jumped[index] < repeats and 0 <= target < len(self.items):
                self._jumped[index] += 1 if count else 0
                index = target
            else:
                index += 1
        return None

    def place(self, index: int, here_ned_m: F64) -> Place | None:
        """Where the item flies to; None for one that flies nowhere. ``here_ned_m`` fills in what it leaves open."""
        item = self.items[index]
        if not item.has_place:
            return None
        where = item.lat_lon_deg
        north_m, east_m = here_ned_m[:2] if where is None else self._origin.north_east_m(*where)
        hold_s = max(item.params[0], 0.0) if item.command in _TIMED and item.params[0] > 0.0 else 0.0
        yaw_deg = item.params[3] if item.command in _WITH_YAW else math.nan
        asked_m = item.params[1] if item.command == mav.MAV_CMD_NAV_WAYPOINT else 0.0
        return Place(
            np.array([north_m, east_m, down_m(item, self._origin, self._home())]),
            asked_m if asked_m > 0.0 else float(self._params["NAV_ACC_RAD"]),
            math.inf if item.command == mav.MAV_CMD_NAV_LOITER_UNLIM else hold_s,
            math.radians(yaw_deg),
        )

    def next_place(self, index: int) -> Place | None:
        """The place after this one, when the way goes on to it without a stop."""
        after = self.resolve(index + 1, count=False)
        while after is not None and not self.items[after].has_place:
            if self.items[after].command in _DELAYS or after + 1 >= len(self.items):
                return None
            after = self.resolve(after + 1, count=False)
        if after is None or self.items[after].command in LANDS | TAKES_OFF:
            return None
        return self.place(after, np.zeros(3)) if self.items[after].lat_lon_deg is not None else None

    def delay_s(self, index: int) -> float:
        """How long a delay item waits; 0 for any other."""
        item = self.items[index]
        return max(item.params[0], 0.0) if item.command in _DELAYS and item.params[0] > 0.0 else 0.0

    def speed_m_s(self, index: int, so_far_m_s: float | None) -> float | None:
        """The ground speed after this item: as before, or changed by it; None is the default speed."""
        item = self.items[index]
        if item.command != mav.MAV_CMD_DO_CHANGE_SPEED or item.params[0] not in _GROUND_SPEEDS:
            return so_far_m_s
        return item.params[1] if item.params[1] > 0.0 else None

    def speed_before_m_s(self, index: int) -> float | None:
        """The ground speed in force when a mission is taken up again at ``index``."""
        speed: float | None = None
        for at in range(min(index, len(self.items))):
            speed = self.speed_m_s(at, speed)
        return speed


def _whole(value: float) -> int:
    return int(value) if math.isfinite(value) else -1
