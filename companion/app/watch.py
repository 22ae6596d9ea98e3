"""Is the vehicle still there, are scans still coming, is it time to ask for OFFBOARD? Judged facts, no sockets.

Silence of the vehicle is counted in wall time (its clock may stand still at a gate); silence of the LiDAR in vehicle
time, so that a vehicle that runs fast, slow or step by step is judged alike.
"""

from dataclasses import dataclass

from companion.core import codec
from companion.core.types import AutopilotStatus, LandedState

ASK_AGAIN_S = 1.0  # wall time between two requests for a mode


@dataclass(slots=True)
class VehicleWatch:
    """Wall-clock watch over the vehicle's voice."""

    started_s: float
    connect_timeout_s: float
    lost_timeout_s: float
    heard_s: float | None = None  # last message of the autopilot
    waiting: bool = False  # it was there, and may come back

    def never_heard(self, now_s: float) -> bool:
        """Nobody has answered in time."""
        return self.heard_s is None and now_s - self.started_s > self.connect_timeout_s

    def lost(self, now_s: float) -> bool:
        """It was there and has fallen silent."""
        return self.heard_s is not None and now_s - self.heard_s > self.lost_timeout_s

    def given_up(self, now_s: float) -> bool:
        """It has been silent for longer than a first word was waited for."""
        patience_s = self.lost_timeout_s + self.connect_timeout_s
        return self.heard_s is not None and now_s - self.heard_s > patience_s


def scan_lost(flying: bool, vehicle_time_s: float, last_scan_s: float, patience_s: float) -> bool:
    """Has the LiDAR been silent for too long, by vehicle time, while we steer?"""
    return flying and vehicle_time_s - last_scan_s > patience_s


@dataclass(slots=True)
class ModeRequest:
    """A mode that is asked for again until it is there."""

    asked_s: float | None = None
    count: int = 0

    def due(self, now_s: float) -> bool:
        """Time to ask (again)? Counts the request."""
        if self.asked_s is not None and now_s - self.asked_s < ASK_AGAIN_S:
            return False
        self.asked_s = now_s
        self.count += 1
        return True


def may_engage(status: AutopilotStatus | None, custom_mode: int | None, engaged_before: bool) -> bool:
    """May OFFBOARD be asked for? Only from a hold in the air, and never again once somebody took it away."""
    return (
        status is not None
        and status.armed
        and status.landed == LandedState.IN_AIR
        and custom_mode == codec.PX4_HOLD
        and not engaged_before
    )
