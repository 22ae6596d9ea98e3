"""How often does it succeed?  A table of flights over many seeds: in process, judged by the truth, over a pool.

``python -m mission.tables trajectory2 --seeds 0:50 --jobs 2`` prints the table and ends with 0 where it holds what is
asked for. Every row can be flown alone, over MAVLink: ``swiftnav fly MISSION --seed SEED``.
"""

import itertools
import math
import statistics
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from companion.app.logs import RECORDS, record_line
from companion.core.params import nearest
from companion.navigator import Record
from mission.cli_options import Json, print_json
from mission.errors import InputError
from mission.flight_plan import FlightPlan, plan_flight
from mission.judge import Result, judge
from mission.side_by_side import side_by_side
from mission.simulate import fly_in_process
from mission.world_generator import forest100
from sitl.truth_log import TruthFile

EXIT_HELD, EXIT_MISSED, EXIT_BAD_INPUT = 0, 1, 2
TIMED_OUT = "time limit of {:g} s reached"


@dataclass(frozen=True, slots=True)
class Asked:
    """A table and what it must hold as a whole; beside it never a flight above its switch bound."""

    mission: str
    seeds: tuple[int, ...]
    success_share: float
    contacts: int | None = None  # at most; None: counted among the failures only
    median_switches: int | None = None  # at most


def tables() -> dict[str, Asked]:
    """Every table by name."""
    fifty = tuple(range(50))
    return {
        "trajectory1": Asked("trajectory1", fifty, 1.0, 0, 6),
        "trajectory2": Asked("trajectory2", fifty, 1.0, 0, 15),
        "trajectory1_movers": Asked("trajectory1_movers", fifty, 0.96),
        "forest100": Asked("forest", forest100().seeds, 0.98, 0),
    }


def table_named(name: str) -> Asked:
    """The table of that name. Raises InputError with the nearest name."""
    known = tables()
    if name not in known:
        raise InputError(f"unknown table '{name}'{nearest(name, list(known))}")
    return known[name]


def fly_and_judge(plan: FlightPlan, folder: Path) -> Result:
    """One flight in process; its logs, as those of a flight over MAVLink, go into ``folder``."""
    with (folder / RECORDS).open("wb") as records:
        flight = fly_in_process(plan, lambda record: _write(records, record))
    truth = TruthFile(folder / "truth.jsonl", flight.sim.spawn_ned_m)
    truth.write(flight.sim.rows)
    truth.close()
    return judge(plan, folder, TIMED_OUT.format(plan.mission.success.time_limit_s) if flight.timed_out else None)


def fly_row(mission: str, seed: int, policy: str | None = None) -> Result:
    """One row of a table, by the mission's policy or by another; the logs are not kept."""
    with tempfile.TemporaryDirectory() as folder:
        return fly_and_judge(plan_flight(mission, seed, policy=policy), Path(folder))


def fly_rows(mission: str, seeds: Sequence[int], jobs: int = 1, policy: str | None = None) -> Iterator[Result]:
    """All rows, in the order of the seeds, each as soon as it is there."""
    work = [(mission, seed, policy) for seed in seeds]
    if jobs == 1:
        yield from itertools.starmap(fly_row, work)
        return
    yield from side_by_side(_fly_item, work, jobs)


def summary(name: str, results: list[Result]) -> dict[str, Any]:
    """The figures of a table, JSON-ready; ``missed`` names what is asked for and not held."""
    errors_m = [r.landing_error_m for r in results if r.landing_error_m is not None]
    clearances_m = [r.min_clearance_m for r in results if r.min_clearance_m is not None]
    ratios = [r.path_ratio for r in results if r.path_ratio is not None]
    figures = {
        "table": name,
        "seeds": f"{results[0].seed}:{results[-1].seed + 1}",
        "flights": len(results),
        "successes": sum(r.success for r in results),
        "contacts": sum(r.collisions > 0 for r in results),
        "median_switches": statistics.median(r.switches for r in results),
        "max_switches": max(r.switches for r in results),
        "above_bound": sum(r.switches > r.switches_bound for r in results),
        "median_time_s": statistics.median(r.time_s for r in results),
        "max_time_s": max(r.time_s for r in results),
        "median_path_ratio": statistics.median(ratios) if ratios else None,
        "max_landing_error_m": max(errors_m, default=None),
        "least_clearance_m": min(clearances_m, default=None),
        "failures": [{"seed": r.seed, "world": r.world, "reason": r.reason} for r in results if not r.success],
    }
    return {**figures, "missed": _missed(table_named(name), figures)}


def print_table(figures: dict[str, Any], console: Console) -> None:
    """The figures, and every failure with seed and reason."""
    table = Table(title=f"{figures['table']}, seeds {figures['seeds']}", title_justify="left")
    table.add_column("figure")
    table.add_column("value", justify="right")
    for name, value in figures.items():
        if name not in ("table", "seeds", "failures", "missed"):
            table.add_row(name, f"{value:.2f}" if isinstance(value, float) else str(value))
    console.print(table)
    if figures["failures"]:
        failures = Table("seed", "world", "reason", title="failures", title_justify="left")
        for row in figures["failures"]:
            failures.add_row(str(row["seed"]), row["world"], row["reason"])
        console.print(failures)
    console.print("missed: " + "; ".join(figures["missed"]) if figures["missed"] else "holds what is asked for")


def chosen_seeds(text: str | None, asked: Asked) -> Sequence[int]:
    """``first:end`` (end excluded) out of the table's own seeds; None: all of them. Raises InputError."""
    if text is None:
        return asked.seeds
    first, _, end = text.partition(":")
    if first.isdecimal() and end.isdecimal() and asked.seeds[0] <= int(first) < int(end) <= asked.seeds[-1] + 1:
        return [seed for seed in asked.seeds if int(first) <= seed < int(end)]
    raise InputError(f"--seeds '{text}' wants FIRST:END within {asked.seeds[0]}:{asked.seeds[-1] + 1}, END excluded")


def main(
    table: Annotated[str, typer.Argument(help="trajectory1, trajectory2, trajectory1_movers or forest100.")],
    seeds: Annotated[str | None, typer.Option(help="FIRST:END, END excluded; default: the whole table.")] = None,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="Processes.")] = 1,
    policy: Annotated[str | None, typer.Option(help="Who flies in RL mode, instead of the mission's.")] = None,
    json: Json = False,
) -> None:
    """Fly a table and judge it. Exit code 0 only where it holds what is asked for."""
    console = Console(stderr=json, highlight=False)
    try:
        asked = table_named(table)
        chosen = chosen_seeds(seeds, asked)
        plan_flight(asked.mission, chosen[0], policy=policy)  # a wrong name is refused before anything flies
    except InputError as error:
        print(f"tables: {error}", file=sys.stderr)
        raise typer.Exit(EXIT_BAD_INPUT) from error
    results = list(track(fly_rows(asked.mission, chosen, jobs, policy), table, len(chosen), console=console))
    figures = summary(table, results)
    print_table(figures, console)
    if json:
        print_json({**figures, "flights_by_seed": [_row(result) for result in results]})
    raise typer.Exit(EXIT_MISSED if figures["missed"] else EXIT_HELD)


def _write(file: BinaryIO, record: Record) -> None:
    file.write(record_line(record.as_dict()))


def _missed(asked: Asked, figures: dict[str, Any]) -> list[str]:
    """Shares are those of the flights made, so that part of a table can be judged too."""
    least = math.ceil(asked.success_share * figures["flights"] - 1e-9)
    missed = []
    if figures["successes"] < least:
        missed.append(f"{figures['successes']} of {figures['flights']} succeeded, asked for are {least}")
    if asked.contacts is not None and figures["contacts"] > asked.contacts:
        missed.append(f"{figures['contacts']} with contact, allowed are {asked.contacts}")
    if asked.median_switches is not None and figures["median_switches"] > asked.median_switches:
        missed.append(f"median of {figures['median_switches']} switches, allowed are {asked.median_switches}")
    if figures["above_bound"]:
        missed.append(f"{figures['above_bound']} above their switch bound")
    return missed


def _fly_item(item: tuple[str, int, str | None]) -> Result:
    return fly_row(*item)


def _row(result: Result) -> dict[str, Any]:
    """A flight in process has neither a folder nor wall timings of a companion."""
    absent = ("log_dir", "tick_p50_ms", "tick_p99_ms", "realtime_factor")
    return {name: value for name, value in result.as_dict().items() if name not in absent}


if __name__ == "__main__":
    typer.run(main)
