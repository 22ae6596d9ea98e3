"""How does the LiDAR of this computer sit on the vehicle, and what do its ranges mean? Tunables; body frd.

They do not touch scans that come as MAVLink: those say of themselves where they point.
"""

import math
from dataclasses import dataclass

from companion.core.params import param


@dataclass(frozen=True, slots=True)
class LidarParams:
    """Mounting and range of a LiDAR on a serial port."""

    mount_yaw_rad: float = param(
        0.0, "SN_LI_YAW", "Where its zero points, from the nose, right positive", "rad", -math.pi, math.pi
    )
    clockwise: bool = param(
        True, "SN_LI_CLOCKWISE", "Its angles grow clockwise seen from above, as mounted: upside down turns it over"
    )
    range_min_m: float = param(
        0.25, "SN_LI_MIN", "Nearer returns are the vehicle's own arms or dirt: unknown", "m", 0.0, 5.0
    )
    range_max_m: float = param(12.0, "SN_LI_MAX", "Farther returns count as nothing there", "m", 1.0, 100.0)
    no_return_free: bool = param(
        True, "SN_LI_FREE", "A ray without a return is free; False: unknown, as dark or wet surfaces are"
    )
    latency_s: float = param(0.0, "SN_LI_LATENCY", "Time between a ray and its bytes at our port", "s", 0.0, 0.5)
