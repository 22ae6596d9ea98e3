"""What do many runs come to? BARN's score with both clips, rates with Wilson intervals, path quality, times; pure."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mission.bench.rows import Row
from mission.errors import InputError
from mission.rates import wilson

BARN_M_S: Final = 2.0  # at which the reference path gives the optimal time
CLIP_05: Final = 2.0  # optimal times below which no more is won: 2024 on, best 0.5
CLIP_025: Final = 4.0  # 2022 and 2023, best 0.25
CLIP_MOST: Final = 8.0
P05: Final = 5


def barn_score(success: bool, time_s: float, reference_m: float, clip: float) -> float:
    """BARN's s = success * OT / clip(AT, ``clip`` OT, 8 OT), OT = reference path length / 2 m/s."""
    if not success:
        return 0.0
    optimal_s = reference_m / BARN_M_S
    return optimal_s / min(max(time_s, clip * optimal_s), CLIP_MOST * optimal_s)


@dataclass(frozen=True, slots=True)
class LogRow:
    """One line of a published log; its score is worked out anew."""

    world: int
    success: bool
    collision: bool
    timeout: bool
    time_s: float


def read_log(path: Path) -> list[LogRow]:
    """A published per-run log: ``world success collided timeout time_s metric``. Raises InputError."""
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            world, success, collision, timeout = (int(word) for word in words[:4])
            rows.append(LogRow(world, bool(success), bool(collision), bool(timeout), float(words[4])))
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{path.name}, line {number}: world, three flags and a time are wanted: {line!r}"
            ) from error
    return rows


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The figures of several runs, JSON-ready. Rates are fractions; times are over the successful runs."""
    minutes = sum(row.time_s for row in rows) / 60.0
    won = [row for row in rows if row.success]
    clearances = [row.min_clearance_m for row in rows if row.min_clearance_m is not None]
    bounds = [row.switches_bound for row in rows]
    decisions = [ms for row in rows for ms in row.decisions_ms]
    return {
        "runs": len(rows),
        **_rates(rows),
        "spl": _mean([_spl(row) for row in rows]),
        "mean_time_s": _mean([row.time_s for row in won]),
        "mean_m_s": _mean([row.mean_m_s for row in won]),
        "score_05": _score(rows, CLIP_05),
        "score_025": _score(rows, CLIP_025),
        "min_clearance_m": min(clearances, default=None),
        "p05_clearance_m": float(np.percentile(clearances, P05)) if clearances else None,
        "jerk_m2_s6": _mean([row.jerk_m2_s6 for row in rows]),
        "switches_per_min": sum(row.switches for row in rows) / minutes if minutes else None,
        "switches_bound_per_min": _per(sum(b for b in bounds if b is not None), minutes) if all_known(bounds) else None,
        "above_bound": sum(b is not None and row.switches > b for row, b in zip(rows, bounds, strict=True)),
        "decision_p50_ms": float(np.percentile(decisions, 50)) if decisions else None,
        "decision_p99_ms": float(np.percentile(decisions, 99)) if decisions else None,
        "tick_p50_ms": _median([row.tick_p50_ms for row in rows]),
        "tick_p99_ms": _median([row.tick_p99_ms for row in rows]),
    }


def all_known(values: Sequence[int | None]) -> bool:
    """Has every run a bound, and is there a run?"""
    return bool(values) and all(value is not None for value in values)


def by_cell(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Runs of each cell, in the order in which the cells first come."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.cell, []).append(row)
    return found


def _rates(rows: Sequence[Row]) -> dict[str, Any]:
    """Each with its 95 % interval."""
    figures: dict[str, Any] = {}
    columns: dict[str, Callable[[Row], bool]] = {
        "success": lambda row: row.success,
        "collision": lambda row: row.collision,
        "struck": lambda row: row.struck,
        "timeout": lambda row: row.timeout,
    }
    for name, hit in columns.items():
        hits = sum(hit(row) for row in rows)
        figures[name] = hits / len(rows) if rows else None
        figures[f"{name}_ci95"] = list(wilson(hits, len(rows)))
    return figures


def _score(rows: Sequence[Row], clip: float) -> float | None:
    """Mean over the runs of a world, then over the worlds; None where there is no reference path."""
    worlds: dict[str, list[float]] = {}
    for row in rows:
        if row.reference_m is None:
            return None
        worlds.setdefault(row.world, []).append(barn_score(row.success, row.time_s, row.reference_m, clip))
    return statistics.fmean(statistics.fmean(scores) for scores in worlds.values()) if worlds else None


def _spl(row: Row) -> float | None:
    if not row.shortest_m:
        return None
    return row.success * row.shortest_m / max(row.path_m, row.shortest_m)


def _per(count: float, minutes: float) -> float | None:
    return count / minutes if minutes else None


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None
