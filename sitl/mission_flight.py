"""How does the vehicle fly its mission? PX4's AUTO.MISSION: items one after the other, with what is reached and said.

Memory: the item being flown and the point that runs ahead. ``update`` at every control tick, then ``demand``.
Local ned.
"""

import math
from collections.abc import Callable
from enum import Enum

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.frames import wrap_rad, yaw_rad
from companion.core.types import F64, VehicleState
from sitl import flight_tasks
from sitl import mission_check as check
from sitl.answers import CRITICAL, INFO, StatusText
from sitl.chaser import Chaser, Pace, Settle, corner_speed_m_s
from sitl.demand import IDLE, Demand
from sitl.geo import Origin
from sitl.geofence import Geofence
from sitl.home import Home
from sitl.mission_items import MissionItem
from sitl.mission_route import LANDS, TAKES_OFF, Place, Route
from sitl.mission_store import MissionStore
from sitl.px4_params import ParamStore


class Work(Enum):
    """What is being done for the current item."""

    CLIMB = "climb"  # straight up first
    MOVE = "move"
    STAY = "stay"  # at the place, for a time
    LAND = "land"


class Ending(Enum):
    """How a mission hands over."""

    HOLD = "hold"
    RETURN = "return"


class MissionFlight:
    """Flies the mission of the store."""

    def __init__(
        self,
        store: MissionStore,
        params: ParamStore,
        home: Callable[[], Home],
        say: Callable[[StatusText], None],
        origin: Origin,
    ) -> None:
        self.reached: int | None = None  # the item reached last since the mission was started or loaded
        self.ending: Ending | None = None  # set when there is nothing more to do
        self._store = store
        self._params = params
        self._say = say
        self._origin = origin
        self._home = home
        self._route = Route((), self._origin, home, params)
        self.active = False
        self._finished = False  # flown to its end; a start after the next disarming begins anew
        self._work = Work.MOVE
        self._place: Place | None = None
        self._climb_ned_m: F64 = np.zeros(3)
        self._since_s = math.inf  # since when at the place
        self._speed_m_s: float | None = None
        self._chaser: Chaser | None = None
        self._land: flight_tasks.Land | None = None

    # --- from outside -----------------------------------------------------------------------------------------

    def load(self) -> None:
        """The mission in the store is a new one."""
        self._route = Route(self._store.mission, self._origin, self._home, self._params)
        self.reached = None
        self._finished = False
        self._place = None

    def objection(self, landed: bool, fence: Geofence) -> str | None:
        """Why PX4 would not fly the mission of the store."""
        place = check.Place(self._origin, self._home(), fence, landed)
        return check.objection(self._store.mission, place, self._params)

    def start(self, flyable: bool, landed: bool) -> None:
        """MISSION mode begins: go on at the current item, or from the start when it was flown before."""
        self.active, self.ending, self.reached = flyable, None, None
        self._place = self._chaser = self._land = None
        if not flyable:
            what = "refusing takeoff" if landed else "loitering"
            self._say(StatusText(CRITICAL, f"No valid mission available, {what}"))
            self.ending = Ending.HOLD
            return
        if self._finished and landed and not self._store.jumped:
            self._store.current = 0
            self._route.forget_jumps()
        self._finished = False
        self._speed_m_s = self._route.speed_before_m_s(self._store.current)
        self._say(StatusText(INFO, "Executing Mission"))

    def stop(self) -> None:
        """Another mode took over; the current item is taken up again later."""
        self.active = False

    @property
    def climbs(self) -> bool:
        """Does it want to leave the ground?"""
        if not self.active or self._finished:
            return False
        return self._place is None or self._work in (Work.CLIMB, Work.MOVE)

    @property
    def landing(self) -> bool:
        """Is it coming down to land?"""
        return self.active and self._work is Work.LAND

    def settle(self) -> flight_tasks.FlightTask | None:
        """What keeps the vehicle at the place where the mission ended."""
        place, chaser = self._place, self._chaser
        if place is None or chaser is None:
            return None
        return Settle(chaser, self._target() if math.isinf(place.radius_m) else place.ned_m, self._pace())

    def set_speed(self, speed_m_s: float | None) -> None:
        """A client changed the speed in flight; None: back to the default."""
        self._speed_m_s = speed_m_s

    # --- time passes ------------------------------------------------------------------------------------------

    def update(self, state: VehicleState, landed: bool) -> None:
        """One control tick while armed in MISSION."""
        if not self.active or self.ending is not None:
            return
        if self._store.jumped:
            self._store.jumped = False
            self._place = None
        chaser = self._chaser = self._chaser or Chaser(state)
        if self._place is None:
            self._begin(state, landed, chaser)
        for _ in range(len(self._route.items) + 1):  # items that take no time follow each other at once
            if self.ending is not None or not self._done(state, landed):
                return
            if self._next_work(state):
                continue
            self._take_next(state, landed, chaser)

    def demand(self, state: VehicleState) -> Demand:
        """What to ask of the control loops now."""
        if self._chaser is None:
            return flight_tasks.hold(state).place
        if self._work is Work.LAND and self._land is not None:
            return self._land.demand(state)
        if self._place is None:
            return IDLE
        return self._chaser.run(state.t_s, self._target(), self._pace(), self._nose_rad(state))

    # --- one item ---------------------------------------------------------------------------------------------

    def _begin(self, state: VehicleState, landed: bool, chaser: Chaser) -> None:
        """Take up the current item."""
        index = self._route.resolve(self._store.current, count=False)
        if index is None:
            self._end(landed)
            return
        self._store.current = index
        self._since_s = math.inf
        self._land = None
        item = self._item
        place = self._route.place(index, chaser.pos_ned_m)
        if place is None:
            self._work = Work.STAY
            self._place = Place(chaser.pos_ned_m.copy(), math.inf, self._route.delay_s(index), math.nan)
            self._speed_m_s = self._route.speed_m_s(index, self._speed_m_s)
            if item.command == mav.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self.ending = Ending.RETURN
            return
        if item.command in LANDS:  # at the height that it has; the descent finds the ground
            place = Place(np.array([*place.ned_m[:2], chaser.pos_ned_m[2]]), place.radius_m, 0.0, math.nan)
        self._work, self._place = Work.MOVE, place
        if landed or item.command in TAKES_OFF:
            self._climb_first(state, landed, place)

    def _climb_first(self, state: VehicleState, landed: bool, place: Place) -> None:
        here_m, home_m = float(state.pos_ned_m[2]), self._home().down_m
        least_m = float(self._params["MIS_TAKEOFF_ALT"])
        down_m = min(float(place.ned_m[2]), (here_m if landed else home_m) - least_m)
        if not landed and down_m > here_m:
            return  # high enough
        self._work = Work.CLIMB
        self._climb_ned_m = np.array([state.pos_ned_m[0], state.pos_ned_m[1], down_m])
        self._say(StatusText(INFO, f"Climb to {home_m - down_m:.1f} meters above home"))

    def _next_work(self, state: VehicleState) -> bool:
        """The next step of the same item, if it has one."""
        if self._work is Work.CLIMB:
            self._work = Work.MOVE
            return True
        if self._work is Work.MOVE and self._item.command in LANDS:
            self._work = Work.LAND
            self._land = self._land_at(self._target(), state)
            return True
        if self._work is Work.MOVE:
            self._work = Work.STAY
            self._since_s = state.t_s
            return True
        return False

    def _land_at(self, ned_m: F64, state: VehicleState) -> flight_tasks.Land:
        yaw = yaw_rad(state.q_ned_frd)
        return flight_tasks.Land(float(ned_m[0]), float(ned_m[1]), yaw, self._params, self._home().down_m)

    def _take_next(self, state: VehicleState, landed: bool, chaser: Chaser) -> None:
        """The item is finished: report it and go on."""
        self.reached = self._store.current
        if not self._item.autocontinue:
            self._work, self._since_s = Work.STAY, math.inf
            return
        after = self._route.resolve(self._store.current + 1)
        if after is None:
            self._end(landed)
            return
        self._store.current = after
        self._begin(state, landed, chaser)

    def _end(self, landed: bool) -> None:
        self._finished = True
        self._route.forget_jumps()
        self.ending = Ending.HOLD
        self._say(StatusText(INFO, f"Mission finished, {'landed' if landed else 'loitering'}"))

    def _done(self, state: VehicleState, landed: bool) -> bool:
        """Is the present step finished?"""
        place = self._place
        if place is None:
            return False
        if self._work is Work.LAND:
            return landed
        if self._work is Work.STAY:
            self._since_s = state.t_s if math.isinf(self._since_s) and self._item.autocontinue else self._since_s
            return state.t_s - self._since_s >= place.hold_s
        if landed:
            return False
        away = self._target() - state.pos_ned_m
        near = abs(float(away[2])) <= self._params["NAV_MC_ALT_RAD"]
        if self._work is Work.CLIMB:
            return near
        return near and math.hypot(away[0], away[1]) <= place.radius_m and self._turned(state, place.yaw_rad)

    def _turned(self, state: VehicleState, wanted_rad: float) -> bool:
        if not math.isfinite(wanted_rad):
            return True
        return abs(wrap_rad(wanted_rad - yaw_rad(state.q_ned_frd))) <= math.radians(self._params["MIS_YAW_ERR"])

    # --- steering ---------------------------------------------------------------------------------------------

    @property
    def _item(self) -> MissionItem:
        return self._route.items[self._store.current]

    def _target(self) -> F64:
        if self._place is None:
            return np.zeros(3)
        return self._climb_ned_m if self._work is Work.CLIMB else self._place.ned_m

    def _pace(self) -> Pace:
        speed_m_s = self._speed_m_s or float(self._params["MPC_XY_CRUISE"])
        return Pace(
            speed_m_s,
            float(self._params["MPC_TKO_SPEED" if self._work is Work.CLIMB else "MPC_Z_V_AUTO_UP"]),
            float(self._params["MPC_Z_V_AUTO_DN"]),
            self._passing_m_s(),
        )

    def _passing_m_s(self) -> float:
        """Speed kept at a place that the way only passes."""
        place, chaser = self._place, self._chaser
        if place is None or chaser is None or self._work is not Work.MOVE or place.hold_s > 0.0:
            return 0.0
        if math.isfinite(place.yaw_rad) or not self._item.autocontinue or self._item.command in LANDS:
            return 0.0
        after = self._route.next_place(self._store.current)
        if after is None:
            return 0.0
        return corner_speed_m_s(place.ned_m - chaser.pos_ned_m, after.ned_m - place.ned_m, place.radius_m)

    def _nose_rad(self, state: VehicleState) -> float:
        """Along the way while there is one, else as the item says."""
        place = self._place
        if place is None or self._work is not Work.MOVE:
            return place.yaw_rad if place is not None and self._work is Work.STAY else math.nan
        if math.isfinite(place.yaw_rad):
            return place.yaw_rad
        away = place.ned_m - state.pos_ned_m
        far = math.hypot(away[0], away[1]) > place.radius_m
        return math.atan2(away[1], away[0]) if far else math.nan
