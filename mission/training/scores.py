"""Which figures sum up several judged flights?  Rates with Wilson intervals, path quality, switching, time; pure."""

import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.checker.checker import VerdictKind
from mission.rates import wilson


@dataclass(frozen=True, slots=True)
class FlightFigures:
    """One judged flight; None where there is nothing to say."""

    seed: int
    world: str
    success: bool
    reason: str
    contact: bool
    timeout: bool
    time_s: float
    path_m: float
    shortest_m: float | None
    min_clearance_m: float | None
    jerk_m2_s6: float | None  # mean square
    switches: int
    switches_bound: int
    rl_time_s: float
    verdicts: dict[str, int]
    guarded: int  # decisions in which the guard flew the expert's path instead
    tick_ms: tuple[float, ...]  # wall time of every tick with a decision

    @property
    def path_ratio(self) -> float | None:
        """Flown to shortest."""
        return self.path_m / self.shortest_m if self.shortest_m else None


def summary(flights: Sequence[FlightFigures]) -> dict[str, Any]:
    """The figures of several flights, JSON-ready. Rates are fractions; ratio and time are over the successful ones."""
    count = len(flights)
    won = [flight for flight in flights if flight.success]
    minutes = sum(flight.time_s for flight in flights) / 60.0
    clearances_m = [f.min_clearance_m for f in flights if f.min_clearance_m is not None]
    verdicts = sum((Counter(flight.verdicts) for flight in flights), Counter[str]())
    tick_ms = [ms for flight in flights for ms in flight.tick_ms]
    return {
        "episodes": count,
        **_rates(flights),
        "spl": _mean([_spl(flight) for flight in flights]),
        "path_ratio": _mean([f.path_ratio for f in won]),
        "time_s": _mean([f.time_s for f in won]),
        "min_clearance_m": min(clearances_m, default=None),
        "p05_clearance_m": float(np.percentile(clearances_m, 5)) if clearances_m else None,
        "jerk_m2_s6": _mean([f.jerk_m2_s6 for f in flights]),
        "switches": statistics.median(f.switches for f in flights) if flights else None,
        "switches_max": max((f.switches for f in flights), default=None),
        "switches_per_min": sum(f.switches for f in flights) / minutes if minutes else None,
        "switches_bound_per_min": sum(f.switches_bound for f in flights) / minutes if minutes else None,
        "above_bound": sum(f.switches > f.switches_bound for f in flights),
        "decisions": verdicts.total(),
        **{str(kind): verdicts[kind] / verdicts.total() if verdicts else None for kind in VerdictKind},
        "guarded": sum(f.guarded for f in flights) / verdicts.total() if verdicts else None,
        "rl_share": sum(f.rl_time_s for f in flights) / (60.0 * minutes) if minutes else None,
        "decision_p50_ms": float(np.percentile(tick_ms, 50)) if tick_ms else None,
        "decision_p99_ms": float(np.percentile(tick_ms, 99)) if tick_ms else None,
        "failures": [{"seed": f.seed, "world": f.world, "reason": f.reason} for f in flights if not f.success],
    }


def _rates(flights: Sequence[FlightFigures]) -> dict[str, Any]:
    """Success, contact and timeout, each with its interval."""
    figures: dict[str, Any] = {}
    for name in ("success", "contact", "timeout"):
        hits = sum(getattr(flight, name) for flight in flights)
        figures[name] = hits / len(flights) if flights else None
        figures[f"{name}_ci95"] = list(wilson(hits, len(flights)))
    return figures


def _spl(flight: FlightFigures) -> float | None:
    """Success weighted by path length; None where there is no shortest path to compare with."""
    if not flight.shortest_m:
        return None
    return flight.success * flight.shortest_m / max(flight.path_m, flight.shortest_m)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None
