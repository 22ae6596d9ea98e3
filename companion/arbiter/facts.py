"""What does the arbiter look at, and against which thresholds? Pure values; distances in metres, scores in [0, 1].

Every judgement is written so that NaN comes out unsafe: an unknown fact is risky, never clear, never fit to land on.
"""

import math
from dataclasses import dataclass

from companion.core.params import ParamError, param


@dataclass(frozen=True, slots=True)
class Facts:
    """One tick, judged by perception and guidance."""

    t_s: float  # vehicle time of the scan
    goal_distance_m: float  # horizontal
    d_min_m: float  # nearest obstacle within sensing radius (eq. dmin); inf when there is none
    s_fuzzy: float  # fuzzy safety score (eq. s_fuzzy)
    line_of_sight: bool  # corridor to the goal is free
    line_done: bool  # the Travel line is used up
    fresh: bool  # state and scan are recent and the autopilot reports OFFBOARD


@dataclass(frozen=True, slots=True)
class ArbiterParams:
    """Asymmetric thresholds, debounce and dwell."""

    d_enter_m: float = param(5.0, "ARB_D_ENTER", "RL may start with an obstacle nearer than this", "m", 0.1, 30.0)
    d_exit_m: float = param(5.5, "ARB_D_EXIT", "RL may end with every obstacle farther than this", "m", 0.1, 30.0)
    s_enter: float = param(0.88, "ARB_S_ENTER", "RL may start with a safety score below this", "", 0.0, 1.0)
    s_exit: float = param(0.90, "ARB_S_EXIT", "RL may end with a safety score above this", "", 0.0, 1.0)
    s_land: float = param(0.30, "ARB_S_LAND", "Landing starts only with a safety score above this", "", 0.0, 1.0)
    s_abort: float = param(0.20, "ARB_S_ABORT", "Landing goes on only with a safety score above this", "", 0.0, 1.0)
    d_land_m: float = param(1.0, "ARB_D_LAND", "Landing starts only with obstacles farther than this", "m", 0.1, 30.0)
    d_abort_m: float = param(
        0.7, "ARB_D_ABORT", "Landing goes on only with obstacles farther than this", "m", 0.1, 30.0
    )
    land_in_m: float = param(2.0, "ARB_LAND_IN", "Landing starts nearer to the goal than this", "m", 0.1, 20.0)
    land_out_m: float = param(3.0, "ARB_LAND_OUT", "Landing ends farther from the goal than this", "m", 0.1, 40.0)
    debounce_ticks: int = param(5, "ARB_DEB_TICKS", "a wish must last this many ticks in a row", "", 1, 1000)
    debounce_s: float = param(0.2, "ARB_DEB_TIME", "and this long: ticks times the scan period", "s", 0.0, 10.0)
    dwell_s: float = param(
        1.0, "ARB_DWELL", "a mode lasts at least this long; a landing abort may not wait", "s", 0.0, 60.0
    )

    def __post_init__(self) -> None:
        """Raise ParamError where an exit threshold does not lie on the safe side of its entry."""
        pairs = (
            ("d_enter_m", "d_exit_m"),
            ("s_enter", "s_exit"),
            ("s_abort", "s_land"),
            ("d_abort_m", "d_land_m"),
            ("land_in_m", "land_out_m"),
        )
        for low, high in pairs:
            if not getattr(self, low) < getattr(self, high):
                raise ParamError(
                    f"parameter '{low}' = {getattr(self, low)} must be below '{high}' = {getattr(self, high)}"
                )


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The thresholds in force this tick, after the sensitivity schedule."""

    d_enter_m: float
    d_exit_m: float
    s_enter: float
    s_exit: float
    s_land: float
    s_abort: float
    d_land_m: float
    d_abort_m: float
    land_in_m: float
    land_out_m: float


def thresholds(params: ArbiterParams, s_scale: float = 1.0, d_scale: float = 1.0) -> Thresholds:
    """Thresholds scaled for the local obstacle density.

    Scores scale by ``s_scale``; the RL distances scale by ``d_scale``; the room that a landing needs does not scale.
    A positive scale keeps every exit on the safe side of its entry.
    """
    return Thresholds(
        d_enter_m=params.d_enter_m * d_scale,
        d_exit_m=params.d_exit_m * d_scale,
        s_enter=params.s_enter * s_scale,
        s_exit=params.s_exit * s_scale,
        s_land=params.s_land * s_scale,
        s_abort=params.s_abort * s_scale,
        d_land_m=params.d_land_m,
        d_abort_m=params.d_abort_m,
        land_in_m=params.land_in_m,
        land_out_m=params.land_out_m,
    )


def unknown(facts: Facts) -> bool:
    """A measured fact is missing."""
    return math.isnan(facts.goal_distance_m) or math.isnan(facts.d_min_m) or math.isnan(facts.s_fuzzy)


def risky(facts: Facts, limits: Thresholds) -> bool:
    """RL is needed (eq. rl_trigger)."""
    return unknown(facts) or (facts.d_min_m < limits.d_enter_m and facts.s_fuzzy < limits.s_enter)


def clear(facts: Facts, limits: Thresholds) -> bool:
    """Travel is safe: score and distance recovered, and the goal in sight."""
    recovered = facts.s_fuzzy > limits.s_exit and facts.d_min_m > limits.d_exit_m
    return recovered and facts.line_of_sight and not unknown(facts)


def landable(facts: Facts, limits: Thresholds) -> bool:
    """Landing may start (eq. land_trigger, land_safety); a used-up line reaches as far as Landing may last."""
    reach_m = limits.land_out_m if facts.line_done else limits.land_in_m
    near = facts.goal_distance_m < reach_m
    return near and facts.s_fuzzy > limits.s_land and facts.d_min_m > limits.d_land_m


def landing_safe(facts: Facts, limits: Thresholds) -> bool:
    """Landing may go on (eq. land_safety, with hysteresis). The descent pauses at once where this is false."""
    return facts.s_fuzzy > limits.s_abort and facts.d_min_m > limits.d_abort_m and not unknown(facts)
