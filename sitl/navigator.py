"""What do uploaded plans and dangers make of the chosen mode? PX4's navigator and failsafe in one place; local ned.

Holds mission, fence and rally points, flies the mission, and names the failsafe in force. Time comes with the state.
"""

from collections.abc import Callable

from companion.core.types import VehicleState
from sitl.answers import CRITICAL, StatusText
from sitl.failsafe import FAILSAFES, Facts, Failsafe
from sitl.geo import Origin
from sitl.guardian import Guardian
from sitl.mission_flight import Ending, MissionFlight
from sitl.mission_items import MissionType
from sitl.mission_store import MissionStore
from sitl.modes import MANUAL, FlightMode
from sitl.px4_params import ParamStore
from sitl.steering import BEHAVIOURS, Steering


class Navigator:
    """Serves one autopilot; steers through its ``steering``."""

    def __init__(
        self, params: ParamStore, steering: Steering, say: Callable[[StatusText], None], origin: Origin
    ) -> None:
        self.plans = MissionStore(self._plan_changed)
        self.mission = MissionFlight(self.plans, params, lambda: steering.home, say, origin)
        self.guardian = Guardian(self.plans, params, lambda: steering.home, say)
        self._steering = steering
        self._origin = origin
        self._say = say
        self._state: VehicleState | None = None
        self._landed = True
        steering.mission, steering.say = self.mission, say

    def mission_flyable(self) -> bool:
        """Is there a mission, and would PX4 fly it?"""
        return bool(self.plans.mission) and self._objection() is None

    def failsafe(self, state: VehicleState, landed: bool, facts: Facts) -> Failsafe | None:
        """One control tick: the failsafe in force. A mode that wants sticks is flown by them where there are any."""
        self._state, self._landed = state, landed
        found = FAILSAFES.get(self.guardian.judge(state, facts))
        if found is not None and found.mode in MANUAL and self._steering.pilot.present(state.t_s):
            return Failsafe(found.mode, BEHAVIOURS[found.mode])
        return found

    def fly(self, wanted: bool, state: VehicleState, landed: bool) -> FlightMode | None:
        """One control tick of an armed vehicle; ``wanted``: MISSION is flown. The mode in which the mission ends."""
        mission = self.mission
        if not wanted:
            if mission.active:
                mission.stop()
            return None
        if not mission.active:
            mission.start(self.mission_flyable(), landed)
        mission.update(state, landed)
        if mission.ending is None:
            return None
        return FlightMode.RTL if mission.ending is Ending.RETURN else FlightMode.HOLD

    def _plan_changed(self, kind: MissionType) -> None:
        """A new mission, fence or list of rally points has come."""
        if kind is MissionType.MISSION:
            self.mission.load()
            why = self._objection()
            if why is not None:
                self._say(StatusText(CRITICAL, why))
            return
        in_air = self._state.pos_ned_m if self._state is not None and not self._landed else None
        self.guardian.load(kind, in_air, self._origin)
        self._steering.safe_points_ned_m = self.guardian.safe_points_ned_m

    def _objection(self) -> str | None:
        return self.mission.objection(self._landed, self.guardian.fence)
