"""How safe is it here? S_fuzzy in [0, 1] from one scan at fixed bearings; pure; bearings frd, 0 nose."""

import numpy as np

from companion.core.types import F64
from companion.perception.polar import BEARING_RAD, BEARINGS

FRONT_DEG, REAR_DEG = 30.0, 150.0  # eq. weights
FRONT_WEIGHT, SIDE_WEIGHT, REAR_WEIGHT = 1.0, 0.5, 0.2  # eq. weights


def directional_weights(bearing_rad: F64) -> F64:
    """Importance of each bearing, w_i (eq. weights): front within 30 deg, rear beyond 150 deg, sides between."""
    off_nose_deg = np.round(np.abs(np.degrees(np.arctan2(np.sin(bearing_rad), np.cos(bearing_rad)))), 9)
    return np.where(
        off_nose_deg <= FRONT_DEG, FRONT_WEIGHT, np.where(off_nose_deg >= REAR_DEG, REAR_WEIGHT, SIDE_WEIGHT)
    )


WEIGHTS = directional_weights(BEARING_RAD)
WEIGHT_SUM = float(WEIGHTS.sum())


def membership(range_m: F64, near_m: float, far_m: float) -> F64:
    """Distance safety r(d) (eq. membership): 0 at or below near_m, 1 at or beyond far_m, 0 where unknown (nan)."""
    return np.fmin(np.fmax((range_m - near_m) / (far_m - near_m), 0.0), 1.0)


def safety_score(bearing_range_m: F64, near_m: float, far_m: float) -> float:
    """Weighted mean membership, S_fuzzy (eq. s_fuzzy), over the fixed bearings (72,)."""
    return float(membership(bearing_range_m, near_m, far_m) @ WEIGHTS) / WEIGHT_SUM


def local_density(bearing_range_m: F64, radius_m: float) -> float:
    """Share of the bearings, in [0, 1], that are blocked or unknown within ``radius_m``."""
    return float(np.count_nonzero(~(bearing_range_m > radius_m)) / BEARINGS)
