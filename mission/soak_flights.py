"""What does a vehicle do all through a soak?  It flies with a companion of its own, there and back again.

Lanes lie side by side: what is measured is endurance, not who gives way.
"""

import contextlib
import time
from pathlib import Path
from threading import Event
from typing import Final

import numpy as np

from mission.errors import FlightError
from mission.pilot import Pilot
from mission.processes import Child, Children, wait_for_end
from mission.runner import COMPANION_PORT
from sitl.link import HOST
from sitl.vehicle_config import VehicleConfig
from sitl.world import World

LEG_M: Final = 150.0
CRUISE_M_S: Final = 4.0
HEARD_WALL_S: Final = 30.0  # that a companion has to find its vehicle
LEG_WALL_S: Final = 300.0
POSTS_M: Final = 12.0  # from one row of trunks to the next


class Flier:
    """Companions and the pilot of one vehicle."""

    def __init__(self, member: VehicleConfig, children: Children, folder: Path, stop: Event) -> None:
        self._member, self._children, self._folder, self._stop = member, children, folder, stop

    def fly(self) -> int:
        """Leg after leg until told to stop; the number of legs. Raises FlightError."""
        legs = 0
        with contextlib.closing(Pilot(self._member.instance, system=self._member.system_id)) as pilot:
            while not self._stop.is_set():
                companion = self._start_companion(0.0 if legs % 2 else LEG_M, legs)
                if not self._one_leg(pilot, companion):
                    break
                legs += 1
        return legs

    def _one_leg(self, pilot: Pilot, companion: Child) -> bool:
        """From the ground to the ground; False when told to stop before."""
        pilot.take_off()
        pilot.set_real("SIM_BAT_MIN_PCT", 80.0)  # the endurance of the software is measured
        pilot.hand_over()
        over = pilot.until(lambda: not pilot.armed or self._stop.is_set(), LEG_WALL_S)
        if self._stop.is_set():
            return False
        if not over or not wait_for_end(companion, 10.0) or companion.exit_code != 0:
            raise FlightError(f"vehicle {self._member.system_id}: {companion.last_line() or 'did not land'}")
        return True

    def _start_companion(self, north_m: float, leg: int) -> Child:
        name = f"companion_{self._member.system_id}_{leg}"
        words = [
            *("--vehicle", f"udpin://{HOST}:{COMPANION_PORT + self._member.instance}"),
            *("--goal", repr(north_m), "0.0", "--cruise", repr(CRUISE_M_S)),
            *("--log", str(self._folder / name)),
        ]
        child = self._children.start(name, "companion", words, self._folder / f"{name}.log")
        deadline_s = time.monotonic() + HEARD_WALL_S
        while " heard on " not in child.log.read_text(encoding="utf-8"):
            if child.exit_code is not None or time.monotonic() > deadline_s:
                raise FlightError(f"companion of vehicle {self._member.system_id}: {child.last_line()}")
            time.sleep(0.05)
        return child


def soak_world() -> World:
    """Lanes 3 m apart, with trunks beside them to look at."""
    rows = np.arange(POSTS_M, LEG_M - POSTS_M, POSTS_M)
    trunks = [[north_m, east_m, 0.3, np.inf] for north_m in rows for east_m in (-30.0, 30.0)]
    bounds_m = (-50.0, -60.0, LEG_M + 50.0, 60.0)
    return World("soak", np.zeros(2), np.array([LEG_M, 0.0]), bounds_m, np.array(trunks), np.zeros((0, 6)))
