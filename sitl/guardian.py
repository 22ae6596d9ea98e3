"""What endangers the vehicle right now? Gathers PX4's failsafe conditions, says them, and gives the action in force.

Link, battery and estimate are told from outside; fence, attitude and the rest are judged here. Local ned; time comes
with the state.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from companion.core.frames import euler_rad
from companion.core.types import F64, VehicleState
from sitl.answers import CRITICAL, EMERGENCY, INFO, StatusText
from sitl.failsafe import Action, Charge, Facts
from sitl.failsafe_keeper import FailsafeKeeper
from sitl.geo import Origin
from sitl.geofence import Breach, Geofence, accept, areas_of
from sitl.home import Home
from sitl.mission_items import MissionType
from sitl.mission_store import MissionStore
from sitl.px4_params import ParamStore

TILTED_FOR_S: Final = 0.3  # FD_FAIL_R_TTRI, FD_FAIL_P_TTRI
CHARGE_TEXTS: Final = {
    Charge.LOW: StatusText(CRITICAL, "Low battery"),
    Charge.CRITICAL: StatusText(CRITICAL, "Critical battery"),
    Charge.EMERGENCY: StatusText(EMERGENCY, "Emergency battery level"),
}


class Guardian:
    """Watches one vehicle."""

    def __init__(
        self, store: MissionStore, params: ParamStore, home: Callable[[], Home], say: Callable[[StatusText], None]
    ) -> None:
        self.fence = Geofence()
        self.safe_points_ned_m: tuple[F64, ...] = ()  # rally points
        self.remaining = 1.0  # charge, told by the battery
        self.position_ok = True  # told by the estimator
        self.attitude_ok = True
        self.sensors_ok = True
        self.motors_ok = True  # told by the motors' controllers
        self.charge = Charge.FINE
        self.breach: Breach | None = None
        self._store = store
        self._home = home
        self._params = params
        self._say = say
        self.gcs_blocked = False  # by a fault: nothing is heard
        self._keeper = FailsafeKeeper(params)
        self._gcs_lost = False
        self._tilted_since_s = math.inf
        self._attitude_failed = False
        self._motor_failed = False

    @property
    def fit(self) -> bool:
        """Would PX4 let the vehicle take off?"""
        return self.position_ok and self.attitude_ok and self.sensors_ok and self.charge < Charge.CRITICAL

    def hear_link(self, gcs_lost: bool) -> None:
        """Is the ground station lost? Lost means: heard before, and silent for longer than COM_DL_LOSS_T."""
        if gcs_lost is not self._gcs_lost:
            self._gcs_lost = gcs_lost
            lost, back = "Connection to ground station lost", "GCS connection regained"
            self._say(StatusText(INFO, lost if gcs_lost else back))

    def load(self, kind: MissionType, here_ned_m: F64 | None, origin: Origin) -> None:
        """A new fence or new rally points; ``here_ned_m``: of a vehicle in the air."""
        items = self._store.items(kind)
        if kind is MissionType.FENCE:
            watched = here_ned_m if self._params["GF_ACTION"] else None
            self.fence, texts = accept(areas_of(items, origin), self._home().pos_ned_m, watched)
            for text in texts:
                self._say(StatusText(CRITICAL, text))
        elif kind is MissionType.RALLY:
            places = (origin.north_east_m(item.x * 1e-7, item.y * 1e-7) for item in items)
            self.safe_points_ned_m = tuple(np.array([n, e, self._home().down_m]) for n, e in places)

    def judge(self, state: VehicleState, facts: Facts) -> Action:
        """One control tick; ``facts`` are those that the commander knows."""
        self._watch_fence(state, facts.armed)
        self._watch_charge(facts.armed)
        self._watch_attitude(state, facts.armed)
        self._watch_motors(facts.armed)
        action = self._keeper.update(facts if self._all_well() else self._completed(facts))
        if self._keeper.text is not None:
            self._say(StatusText(CRITICAL, self._keeper.text))
        return action

    def _all_well(self) -> bool:
        """Nothing to add to the commander's facts? Nearly always: building them anew would be the dearest step here."""
        told = self.position_ok and self.attitude_ok and not (self._gcs_lost or self.gcs_blocked)
        failed = self._attitude_failed or self._motor_failed
        return told and self.charge is Charge.FINE and self.breach is None and not failed

    def _completed(self, facts: Facts) -> Facts:
        return replace(
            facts,
            gcs_lost=self._gcs_lost or self.gcs_blocked,
            breached=self.breach is not None,
            charge=self.charge,
            attitude_failed=self._attitude_failed,
            motor_failed=self._motor_failed,
            position_ok=self.position_ok,
            attitude_ok=self.attitude_ok,
        )

    def _watch_fence(self, state: VehicleState, armed: bool) -> None:
        breach = (
            self.fence.breach(state.pos_ned_m, self._home().pos_ned_m, self._params)
            if self._params["GF_ACTION"]
            else None
        )
        if breach is not self.breach and breach is not None and armed:
            self._say(StatusText(CRITICAL, breach.value))
        self.breach = breach

    def _watch_charge(self, armed: bool) -> None:
        """In flight a warning only gets worse."""
        charge = _charge(self.remaining, self._params)
        charge = max(charge, self.charge) if armed else charge
        if charge > self.charge:
            self._say(CHARGE_TEXTS[charge])
        self.charge = charge

    def _watch_attitude(self, state: VehicleState, armed: bool) -> None:
        """PX4's failure detector: too much roll or pitch for too long."""
        roll_rad, pitch_rad, _ = euler_rad(state.q_ned_frd)
        tilted = _beyond(roll_rad, self._params["FD_FAIL_R"]) or _beyond(pitch_rad, self._params["FD_FAIL_P"])
        self._tilted_since_s = min(self._tilted_since_s, state.t_s) if tilted and armed else math.inf
        failed = state.t_s - self._tilted_since_s >= TILTED_FOR_S
        if failed and not self._attitude_failed:
            self._say(StatusText(CRITICAL, "Attitude failure detected"))
        self._attitude_failed = failed

    def _watch_motors(self, armed: bool) -> None:
        failed = armed and not self.motors_ok and bool(self._params["FD_ACT_EN"])
        if failed and not self._motor_failed:
            self._say(StatusText(CRITICAL, "Motor failure detected"))
        self._motor_failed = failed


def _beyond(angle_rad: float, limit_deg: float) -> bool:
    """Past a limit; 0 is none."""
    return limit_deg > 0 and abs(angle_rad) > math.radians(limit_deg)


def _charge(remaining: float, params: ParamStore) -> Charge:
    if remaining < params["BAT_EMERGEN_THR"]:
        return Charge.EMERGENCY
    if remaining < params["BAT_CRIT_THR"]:
        return Charge.CRITICAL
    return Charge.LOW if remaining < params["BAT_LOW_THR"] else Charge.FINE
