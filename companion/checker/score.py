"""How good is a polyline that passes? Clearance, curvature and progress as one number (eq. checker_score); pure.

Mirroring everything leaves the score as it is.
"""

import itertools
import math

from companion.checker.params import CheckerParams
from companion.core import geometry
from companion.core.types import F64

MOVING_M_S = 0.5  # from here up the first turn is counted from the present course


def score(path_ned_m: F64, vel_ned_m_s: F64, goal_ned_m: F64, clearance_m: float, params: CheckerParams) -> float:
    """Weighted clearance share in [0, 1], minus half turns, plus goal distance won per metre in [-1, 1]."""
    share = min(max(clearance_m / params.clearance_full_m, 0.0), 1.0)
    return (
        params.weight_clearance * share
        - params.weight_curvature * turning_rad(path_ned_m, vel_ned_m_s) / math.pi
        + params.weight_progress * progress_ratio(path_ned_m, goal_ned_m)
    )


def turning_rad(path_ned_m: F64, vel_ned_m_s: F64) -> float:
    """Sum of the absolute turns along the path, the first from the present course if the vehicle moves."""
    courses = [math.atan2(piece.dir_east, piece.dir_north) for piece in geometry.segments(path_ned_m)]
    north, east = float(vel_ned_m_s[0]), float(vel_ned_m_s[1])
    if math.hypot(north, east) >= MOVING_M_S:
        courses.insert(0, math.atan2(east, north))
    return sum(abs(math.remainder(b - a, math.tau)) for a, b in itertools.pairwise(courses))


def progress_ratio(path_ned_m: F64, goal_ned_m: F64) -> float:
    """Goal distance won per metre flown."""
    flown = geometry.length(path_ned_m)
    if not flown > 0.0:
        return 0.0
    won = math.dist(path_ned_m[0].tolist(), goal_ned_m.tolist()) - math.dist(
        path_ned_m[-1].tolist(), goal_ned_m.tolist()
    )
    return won / flown
