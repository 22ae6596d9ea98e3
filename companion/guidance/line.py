"""Where is the vehicle relative to its guidance line, and which course brings it back?

Pure. The paper's plane (x, y) is our (north, east): angles grow from north to east, ``n`` points to the right of ``t``,
so a positive cross-track error means right of the line. The laws as printed (eq. stanley) steer away from the line with
these errors; here they are negated and steer back.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.frames import wrap_rad
from companion.core.params import ParamError, param
from companion.core.types import F64

VERTICAL_EPS_M = 1e-9  # eq. line_kb: below this the line has no slope
SPEED_EPS_M_S = 0.1  # epsilon of eq. stanley: keeps the correction finite at a standstill
LAWS = ("stanley", "pd")


@dataclass(frozen=True, slots=True)
class LineParams:
    """Gains of the two line-following laws."""

    law: str = param("stanley", "LINE_LAW", "course correction in Travel: stanley or pd")
    k_s: float = param(0.5, "LINE_K_S", "Stanley gain on the cross-track error", "1/s", 0.0, 10.0)
    k_psi: float = param(1.5, "LINE_K_PSI", "PD gain on the heading error", "1/s", 0.01, 10.0)
    k_y: float = param(0.5, "LINE_K_Y", "PD gain on the cross-track error", "rad/m/s", 0.0, 10.0)
    max_rate_rad_s: float = param(1.0, "LINE_MAX_RATE", "limit of the PD law", "rad/s", 0.01, 10.0)
    max_course_rad: float = param(0.8, "LINE_MAX_COURSE", "largest course off the line", "rad", 0.01, 1.5)

    def __post_init__(self) -> None:
        """Raise ParamError for an unknown law."""
        if self.law not in LAWS:
            raise ParamError(f"parameter 'law' = {self.law!r} is none of {', '.join(LAWS)}")


@dataclass(frozen=True, slots=True)
class GuidanceLine:
    """Line through the position at mode entry and the goal, frozen until the next entry (eq. param_line)."""

    origin_ned_m: F64  # (2,)
    goal_ned_m: F64  # (2,)
    t: F64  # (2,) unit, along
    n: F64  # (2,) unit, to the right
    course_rad: float  # psi_g
    length_m: float


@dataclass(frozen=True, slots=True)
class LineErrors:
    """Position and heading relative to the line."""

    cross_track_m: float  # e_perp, positive to the right
    heading_rad: float  # e_psi, positive clockwise
    progress_m: float  # s


def line_through(origin_ned_m: F64, goal_ned_m: F64) -> GuidanceLine:
    """Freeze the line (eq. travel_defs); both points (2,). A line of no length points north."""
    delta = goal_ned_m - origin_ned_m
    course = math.atan2(float(delta[1]), float(delta[0]))
    return GuidanceLine(
        origin_ned_m=np.array(origin_ned_m, dtype=np.float64),
        goal_ned_m=np.array(goal_ned_m, dtype=np.float64),
        t=np.array([math.cos(course), math.sin(course)]),
        n=np.array([-math.sin(course), math.cos(course)]),
        course_rad=course,
        length_m=float(np.hypot(delta[0], delta[1])),
    )


def slope_intercept(line: GuidanceLine) -> tuple[float, float] | None:
    """k and b of east = k north + b (eq. line_kb), or None where the line runs due east or west."""
    delta = line.goal_ned_m - line.origin_ned_m
    if abs(float(delta[0])) <= VERTICAL_EPS_M:
        return None
    k = float(delta[1] / delta[0])
    return k, float(line.origin_ned_m[1] - k * line.origin_ned_m[0])


def errors(line: GuidanceLine, pos_ned_m: F64, heading_rad: float) -> LineErrors:
    """Errors of a position (2,) and a heading (yaw or course) against the line."""
    offset = pos_ned_m - line.origin_ned_m
    return LineErrors(
        cross_track_m=float(line.n @ offset),
        heading_rad=wrap_rad(heading_rad - line.course_rad),
        progress_m=float(line.t @ offset),
    )


def done(line: GuidanceLine, pos_ned_m: F64) -> bool:
    """The line is used up."""
    return float(line.t @ (pos_ned_m - line.origin_ned_m)) >= line.length_m


def stanley_rad(cross_track_m: float, heading_rad: float, speed_m_s: float, params: LineParams) -> float:
    """Turn to make, eq. stanley negated."""
    return -(heading_rad + math.atan(params.k_s * cross_track_m / (abs(speed_m_s) + SPEED_EPS_M_S)))


def pd_rad_s(cross_track_m: float, heading_rad: float, params: LineParams) -> float:
    """Turn rate, the PD form negated; the cross-track term saturates first so that no offset makes it circle."""
    pull = params.k_psi * params.max_course_rad
    rate = -(params.k_psi * heading_rad + _clip(params.k_y * cross_track_m, pull))
    return _clip(rate, params.max_rate_rad_s)


def course_rad(line: GuidanceLine, pos_ned_m: F64, speed_m_s: float, params: LineParams) -> float:
    """Course to fly from a position (2,): the heading at which the chosen law asks for no turn."""
    cross_track_m = float(line.n @ (pos_ned_m - line.origin_ned_m))
    if params.law == "pd":
        correction = -_clip(params.k_y * cross_track_m / params.k_psi, params.max_course_rad)
    else:
        correction = _clip(stanley_rad(cross_track_m, 0.0, speed_m_s, params), params.max_course_rad)
    return wrap_rad(line.course_rad + correction)


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
