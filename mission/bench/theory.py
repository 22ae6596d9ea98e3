"""What can no pilot exceed? Stop-distance speed, Loquercio's ceiling, the switch bound; pure formulas, SI."""

import math
from typing import Final

from companion.arbiter.arbiter import switch_bound
from companion.arbiter.facts import ArbiterParams
from companion.guidance.limits import stopping_speed

TILT_RAD: Final = math.radians(35.0)
GRAVITY_M_S2: Final = 9.80665
# Of a vehicle with PX4's gains: scan, link, tick and tilt lag before a push aside bites.
LATENCY_S: Final = 0.28


def lateral_m_s2() -> float:
    """Sideways acceleration of level flight at the tilt limit."""
    return GRAVITY_M_S2 * math.tan(TILT_RAD)


def stop_distance_speed(sense_m: float, radius_m: float, margin_m: float, decel_m_s2: float, tau_s: float) -> float:
    """Fastest speed that always stops within what is seen."""
    return stopping_speed(sense_m - radius_m - margin_m, decel_m_s2, tau_s)


def evasion_speed(ahead_m: float, obstacle_radius_m: float, vehicle_radius_m: float, latency_s: float) -> float:
    """Loquercio's ceiling v = s / (t + sqrt(2 r / (c sin phi))): what one obstacle leaves time to dodge.

    ``ahead_m`` to the obstacle's middle, beside which the dodge must be complete; ``r`` is the way aside: both radii;
    ``c sin phi`` is the sideways acceleration at the tilt limit, height held.
    """
    aside_m = obstacle_radius_m + vehicle_radius_m
    return ahead_m / (latency_s + math.sqrt(2.0 * aside_m / lateral_m_s2()))


def switches_per_min(params: ArbiterParams) -> int:
    """Most switches of nav mode within any minute, aborted landings aside."""
    return switch_bound(60.0, params)
