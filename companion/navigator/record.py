"""What did one tick see, judge and ask for? Flat JSON-ready values; no wall clock, so it can be compared bytewise."""

import math
from dataclasses import dataclass
from typing import Any

from companion.core.inputs import Inputs
from companion.core.types import F64, Setpoint
from companion.guidance.line import LineErrors, slope_intercept
from companion.navigator.decide import Decision
from companion.navigator.memory import Engagement, Memory
from companion.navigator.track import Tracked
from companion.perception.perceive import Percept

STANDBY, HOLD = "standby", "hold"


@dataclass(frozen=True, slots=True)
class Record:
    """One tick."""

    inputs: Inputs
    percept: Percept
    memory: Memory  # after the tick
    setpoint: Setpoint
    goal_distance_m: float
    switches_bound: int = 0
    tracked: Tracked | None = None
    decision: Decision | None = None
    line_errors: LineErrors | None = None  # against the line of the present or last Travel
    touchdown: bool = False  # eq. land_terminate held for T_settle

    @property
    def mode(self) -> str:
        """Nav mode, or 'standby' while the autopilot is not in OFFBOARD, or 'hold' for the overlay."""
        engaged = self.memory.engaged
        if engaged is None:
            return STANDBY
        return HOLD if engaged.arbiter.hold else str(engaged.arbiter.mode)

    def as_dict(self) -> dict[str, Any]:
        """Key order is fixed; inf and nan become null."""
        state, percept, engaged = self.inputs.state, self.percept, self.memory.engaged
        row: dict[str, Any] = {
            "t_s": self.inputs.scan.t_s,
            "mode": self.mode,
            "pos_ned_m": _list(state.pos_ned_m),
            "vel_ned_m_s": _list(state.vel_ned_m_s),
            "q_ned_frd": _list(state.q_ned_frd),
            "d_min_m": _number(percept.d_min_m),
            "s_fuzzy": _number(percept.s_fuzzy),
            "density": percept.density,
            "scale": percept.scale,
            "line_of_sight": percept.line_of_sight,
            "goal_distance_m": _number(self.goal_distance_m),
            "fresh": self.inputs.fresh,
            "points": len(percept.points_ne_m),
            "decisions": self.memory.decisions,
            "switches": engaged.arbiter.switches if engaged else 0,
            "aborts": engaged.arbiter.aborts if engaged else 0,
            "holds": engaged.arbiter.hold_count if engaged else 0,
            "switches_bound": self.switches_bound,
            "stopping": engaged is not None and engaged.stop is not None,
            "speed_m_s": self.tracked.speed_m_s if self.tracked else None,
            "free_m": _number(self.tracked.free_m) if self.tracked else None,
            "lateral_m": _number(self.tracked.lateral_m) if self.tracked else None,
            "cross_track_m": _number(self.line_errors.cross_track_m) if self.line_errors else None,
            "heading_error_rad": _number(self.line_errors.heading_rad) if self.line_errors else None,
            "line_kb": _line_kb(engaged),
            "touchdown": self.touchdown,
            "sp_pos_ned_m": _list(self.setpoint.pos_ned_m),
            "sp_vel_ned_m_s": _list(self.setpoint.vel_ned_m_s),
            "sp_acc_ned_m_s2": _list(self.setpoint.acc_ned_m_s2),
            "sp_yaw_rad": self.setpoint.yaw_rad,
        }
        if self.memory.tight.aside is not None:
            row["tight"] = True
        if self.decision is not None:
            row |= _decided(self.decision)
        return row


def _line_kb(engaged: Engagement | None) -> list[float] | None:
    """Slope and intercept of the frozen line (eq. line_kb); null while standing by or where it runs east or west."""
    kb = slope_intercept(engaged.line) if engaged else None
    return None if kb is None else list(kb)


def _decided(decision: Decision) -> dict[str, Any]:
    verdict = decision.verdict
    return {
        "proposal_ne_m": _rows(decision.proposal_ne_m),
        "guarded": decision.guarded,
        "verdict": str(verdict.kind),
        "choice": verdict.choice,
        "path_ne_m": _rows(verdict.path_ned_m),
        "margin_m": verdict.margin_m,
        "clearance_m": _number(verdict.clearance_m),
        "score": _number(verdict.score),
    }


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _list(values: F64 | None) -> list[float] | None:
    return None if values is None else [float(v) for v in values]


def _rows(values: F64 | None) -> list[list[float]] | None:
    return None if values is None else [[float(v) for v in row] for row in values]
