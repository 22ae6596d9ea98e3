"""What makes a flight harder? One thing at a time: worse sensors, worse air, a worse estimate. Pilots are not told."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from companion.core.params import nearest
from companion.core.types import Scan
from mission.errors import InputError


@dataclass(frozen=True, slots=True)
class Stress:
    """None keeps what the suite says."""

    name: str
    text: str
    sigma_m: float | None = None
    dropout: float = 0.0
    rate_hz: float | None = None
    latency_s: float | None = None  # from scan to setpoint in force
    faults: tuple[str, ...] = ()  # as ``sitl.faults`` reads them
    blind_behind: bool = False

    def seen(self, scan: Scan) -> Scan:
        """The scan as it reaches the pilot."""
        if not self.blind_behind:
            return scan
        bearing_rad = scan.angle_offset_rad + np.arange(len(scan.range_m)) * scan.increment_rad
        return replace(scan, range_m=np.where(np.cos(bearing_rad) < -1e-9, np.nan, scan.range_m))


NONE: Final = Stress("none", "as the suite says")
STRESSES: Final = {
    stress.name: stress
    for stress in (
        NONE,
        Stress("noise", "range noise of 3 cm", sigma_m=0.03),
        Stress("dropouts", "5 % of the rays lost", dropout=0.05),
        Stress("latency", "scans at 10 Hz, 100 ms from scan to setpoint", rate_hz=10.0, latency_s=0.1),
        Stress("gusts", "gusts of 5 m/s (two standard deviations) on both axes", faults=("gusts=2.5",)),
        Stress("drift", "the estimated position walks off, 0.5 m rms after a minute", faults=("position_drift=0.5",)),
        Stress("blind", "the rear half of the sectors unknown", blind_behind=True),
    )
}


def stress_named(name: str) -> Stress:
    """The stress of that name. Raises InputError with the nearest name."""
    if name not in STRESSES:
        raise InputError(f"unknown stress '{name}'{nearest(name, list(STRESSES))}")
    return STRESSES[name]
