"""Which figures sum up one seed of an arm, and all its seeds?  From the rows in its folder; pure but for reading them.

*First* and *last* are means over the first and the last fifteen episodes, *smooth* is the paper's 15-episode moving
average (whole windows only). A figure that cannot be told is None.
"""

import json
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from companion.core.types import F64
from mission.flight_log import read_rows
from mission.reproduce.greedy import GREEDY, gained_m
from mission.training.figures import WINDOW, moving_average
from mission.training.fleet import seed_folder
from mission.training.metrics import rows_file
from mission.training.trainer import RESULT
from mission.training.until import Until

Row = dict[str, Any]
Figures = dict[str, float | None]
SETTLED = 50  # episodes, "a few dozen": from here on a tight band is a tight band
FIRST_SHARE = 100  # episodes, which every seed that got its 100 successes has had
LAST_SHARE = 50  # episodes over which late success is counted
LEAST_GAIN_M = 1.0  # a track that gained less counts as this: going nowhere is a long detour, not an endless one
CONFIDENCE = 0.95
SHARES = ("reached", "success_last50", "contact", "rl_share", "greedy_success", "greedy_contact")
COUNTS = ("episodes", "successes", "successes_first100", "ticks", "switches", "above_bound", "hasty", "wall_s")
STAMP = ("date", "commit", "machine")


@dataclass(frozen=True, slots=True)
class SeedRows:
    """What lies in a seed's folder."""

    seed: int
    episodes: list[Row]
    tracks: dict[int, F64]  # by episode, (n, 2) world
    evaluations: list[Row]  # greedy flights at checkpoints; the first seed's first beside policies that learn nothing
    flights: list[Row]  # greedy, at the end
    decision_p99_ms: float | None
    stamp: dict[str, str]  # date, commit, machine
    result: Row | None  # None: not done

    @property
    def done(self) -> bool:
        """Trained to its end, and flown greedily."""
        return self.result is not None and bool(self.flights)


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean over seeds and its 95 % interval (Student's t); no interval with one seed."""

    mean: float
    low: float | None
    high: float | None
    seeds: int


def read_seed(folder: Path, seed: int) -> SeedRows:
    """All of one seed; empty where nothing was done."""
    at = seed_folder(folder, seed)
    result, greedy = _json(at / RESULT), _json(at / GREEDY) or {}
    return SeedRows(
        seed,
        list(read_rows(rows_file(at, "episodes"))),
        {row["episode"]: np.array(row["track_ne_m"]) for row in read_rows(rows_file(at, "tracks"))},
        list(read_rows(rows_file(at, "evaluations"))),
        greedy.get("flights", []),
        greedy.get("decision_p99_ms"),
        {name: greedy[name] for name in STAMP if name in greedy},
        result,
    )


def figures_of(rows: SeedRows, until: Until, goal_ne_m: F64 | None) -> Figures:
    """One seed in figures. ``goal_ne_m`` (2,): of a world that all episodes share, None otherwise."""
    episodes = rows.episodes
    wins = [float(row["success"]) for row in episodes]
    return {
        "episodes": float(len(episodes)),
        "successes": sum(wins),
        "reached": float(sum(wins) >= until.successes),
        "ticks": float(sum(row["ticks"] for row in episodes)),
        "successes_first100": sum(wins[:FIRST_SHARE]) if len(wins) >= FIRST_SHARE else None,
        "success_last50": _mean(wins[-LAST_SHARE:]),
        "contact": _mean([float(row["contact"]) for row in episodes]),
        "switches": _mean([row["switches"] for row in episodes]),
        "above_bound": float(sum(row["switches"] > row["switches_bound"] for row in episodes)),
        "hasty": _mean([row["hasty_switches"] for row in episodes]),
        "rl_share": _share(episodes),
        "path_ratio_last50": _mean([row["path_ratio"] for row in episodes[-LAST_SHARE:] if row["success"]]),
        **_trend("steps", [row["steps"] for row in episodes]),
        **_trend("return", [row["return"] for row in episodes]),
        **_detours(rows, goal_ne_m),
        **_greedy(rows),
        "wall_s": _wall_s(rows.result),
    }


def over_seeds(values: Sequence[float | None]) -> Interval | None:
    """None where no seed has a value."""
    known = [value for value in values if value is not None]
    if not known:
        return None
    mean = statistics.fmean(known)
    if len(known) == 1:
        return Interval(mean, None, None, 1)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, len(known) - 1)) * statistics.stdev(known) / math.sqrt(len(known))
    return Interval(mean, mean - half, mean + half, len(known))


def interval_of(seeds: Sequence[Figures], name: str) -> Interval | None:
    """A figure over seeds; the interval of a share stays in [0, 1], that of a count above 0."""
    found = over_seeds([seed.get(name) for seed in seeds])
    if found is None or found.low is None or found.high is None or name not in (*SHARES, *COUNTS):
        return found
    high = min(found.high, 1.0) if name in SHARES else found.high
    return Interval(found.mean, max(found.low, 0.0), high, found.seeds)


def smooth(values: Sequence[float]) -> F64:
    """The moving average over whole windows; empty for fewer episodes than one."""
    return moving_average(np.array(values, np.float64), WINDOW)[WINDOW - 1 :]


def _trend(name: str, values: Sequence[float]) -> Figures:
    """Where a curve begins and ends, how wide its tail is, how much it wobbles."""
    names = ("first", "last", "sd_first", "sd_last", "highest", "tail_width", "wobble", "wobble_mid", "wobble_late")
    curve = smooth(values)
    if len(curve) < 2 * WINDOW:
        return {f"{name}_{part}": None for part in names}
    first, last = np.array(values[:WINDOW]), np.array(values[-WINDOW:])
    tail = curve[SETTLED - WINDOW :]
    wobbles = [_wobble(part) for part in np.array_split(curve, 3)]
    found = (
        np.mean(first),
        np.mean(last),
        np.std(first),
        np.std(last),
        np.max(curve),
        np.ptp(tail) / max(abs(float(np.mean(tail))), 1e-9) if len(tail) >= WINDOW else None,
        np.mean(wobbles),
        wobbles[1],
        wobbles[2],
    )
    return {f"{name}_{part}": None if x is None else float(x) for part, x in zip(names, found, strict=True)}


def _wobble(values: F64) -> float:
    """Standard deviation from the straight line through a piece of a curve."""
    at = np.arange(len(values))
    return float(np.std(values - np.polyval(np.polyfit(at, values, 1), at)))


def _detours(rows: SeedRows, goal_ne_m: F64 | None) -> Figures:
    """Metres flown for a metre nearer to the goal, first and last; medians."""
    if goal_ne_m is None or len(rows.episodes) < 2 * WINDOW:
        return {"detour_first": None, "detour_last": None}
    detours = [
        _detour(row["path_m"], gained_m(rows.tracks[row["episode"]], goal_ne_m))
        for row in rows.episodes
        if row["episode"] in rows.tracks
    ]
    return {"detour_first": _median(detours[:WINDOW]), "detour_last": _median(detours[-WINDOW:])}


def _greedy(rows: SeedRows) -> Figures:
    flights = rows.flights
    won = [flight for flight in flights if flight["success"]]
    return {
        "greedy_success": _mean([float(flight["success"]) for flight in flights]),
        "greedy_contact": _mean([float(flight["contact"]) for flight in flights]),
        "greedy_path_ratio": _mean([flight["path_ratio"] for flight in won]),
        "greedy_time_s": _mean([flight["time_s"] for flight in won]),
        "greedy_switches": _mean([flight["switches"] for flight in flights]),
        "greedy_hasty": _mean([flight["hasty_switches"] for flight in flights]),
        "greedy_detour": _median([_detour(flight["path_m"], flight["gained_m"]) for flight in flights]),
        "greedy_turning": _median([flight["turning_deg_per_m"] for flight in flights]),
        "decision_p99_ms": rows.decision_p99_ms,
    }


def _detour(path_m: float, gained: float) -> float:
    return path_m / max(gained, LEAST_GAIN_M)


def _share(episodes: Sequence[Row]) -> float | None:
    time_s = sum(row["time_s"] for row in episodes)
    return sum(row["rl_time_s"] for row in episodes) / time_s if time_s else None


def _wall_s(result: Row | None) -> float | None:
    if result is None:
        return None
    return float(sum(spent_s for name, spent_s in result["seconds"].items() if name != "evaluation"))


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


def _json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
