"""At which instants does the vehicle clock wait for somebody? Pure.

Clients count wall time, a fast vehicle does not: where a flight waits for a command, vehicle time stops until the
command has come, so that the same commands act at the same vehicle instants. Every gate is passed once, in order.
"""

from enum import Enum

from sitl.modes import FlightMode
from sitl.simulation import Simulation


class Gate(Enum):
    """What vehicle time waits for."""

    COMPANION = "companion"  # to be heard
    ARM = "arm"
    TAKEOFF = "takeoff"
    OFFBOARD = "offboard"
    END = "end"  # nothing more: the flight is over


ORDER = (Gate.COMPANION, Gate.ARM, Gate.TAKEOFF, Gate.OFFBOARD, Gate.END)


class GateKeeper:
    """Remembers which gates have been passed."""

    def __init__(self, companion: bool = True, end: bool = True) -> None:
        """``companion=False`` leaves out the gate that waits for one, ``end=False`` the last: others still fly."""
        left_out = {Gate.COMPANION: not companion, Gate.END: not end}
        self._left = [gate for gate in ORDER if not left_out.get(gate, False)]

    def waiting(self, simulation: Simulation, companion_heard: bool = True) -> Gate | None:
        """The gate at which vehicle time has to stand still now."""
        while self._left:
            reached, passed = _judge(self._left[0], simulation, companion_heard)
            if not passed:
                return self._left[0] if reached else None
            self._left.pop(0)
        return None


def _judge(gate: Gate, simulation: Simulation, companion_heard: bool) -> tuple[bool, bool]:
    """Has the vehicle come to the gate, and has what it waits for happened?"""
    autopilot = simulation.autopilot
    if gate is Gate.COMPANION:
        return True, companion_heard
    if gate is Gate.ARM:
        return autopilot.ready, autopilot.armed
    if gate is Gate.TAKEOFF:
        return True, autopilot.mode is not FlightMode.HOLD
    if gate is Gate.OFFBOARD:
        leaving = autopilot.mode not in (FlightMode.TAKEOFF, FlightMode.HOLD)
        return autopilot.mode is FlightMode.HOLD, leaving
    return simulation.finished, False
