"""What does one navigator tick see? A value; local ned, body frd."""

from dataclasses import dataclass

from companion.core.types import AutopilotStatus, Scan, VehicleState


@dataclass(frozen=True, slots=True)
class Inputs:
    """One scan and what the autopilot said at its instant: all that a tick may know of the world."""

    state: VehicleState  # at the scan's instant
    scan: Scan
    status: AutopilotStatus
    fresh: bool = True  # False: the state or the scan is older than the link allows (by vehicle time)
