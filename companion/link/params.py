"""How old may what we hear be? Tunables of the link."""

from dataclasses import dataclass

from companion.core.params import param


@dataclass(frozen=True, slots=True)
class LinkParams:
    """Staleness by vehicle time, and how LiDAR time stamps are to be read."""

    max_state_age_s: float = param(
        0.2, "SN_STATE_AGE", "A scan whose nearest state sample is further off than this is not fresh", "s", 0.01, 2.0
    )
    max_scan_age_s: float = param(
        0.3, "SN_SCAN_AGE", "A scan older than this against the newest state sample is not fresh", "s", 0.02, 2.0
    )
    scan_lost_s: float = param(
        0.5, "SN_SCAN_LOST", "Without a scan for this long in flight the companion brakes and holds", "s", 0.05, 10.0
    )
    arrival_stamps: bool = param(
        False, "SN_SCAN_ARRIVAL", "The LiDAR does not know vehicle time: stamp scans with the newest state sample"
    )
    lidar_component: int = param(
        0, "SN_LIDAR_COMP", "Take scans only from this MAVLink component id; 0 takes them from any", "", 0, 255
    )
