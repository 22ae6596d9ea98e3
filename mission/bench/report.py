"""What is said of a flown suite? One object for machines, a table for people, a log as the published ones."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from mission.bench.entry import Entry
from mission.bench.rows import Row, barn_log
from mission.bench.scores import CLIP_05, barn_score, by_cell, summary

LOG = "barn.log"
HEADS = ("cell", "runs", "success [95 %]", "contact", "struck", "timeout", "SPL", "time s", "score .5 / .25", "least m")


def figures_of(suite: str, entry: Entry, rows: Sequence[Row], skipped: int = 0) -> dict[str, Any]:
    """``bench --json``: the suite as a whole, and each of its cells."""
    cells = by_cell(rows)
    return {
        "suite": suite,
        "pilot": entry.pilot,
        "profile": entry.profile,
        "stress": entry.stress,
        "skipped_worlds": skipped,
        **summary(rows),
        "cells": {name: summary(found) for name, found in cells.items()} if len(cells) > 1 else {},
        "failures": [{"world": row.world, "run": row.run, "end": row.end} for row in rows if not row.success],
    }


def write_log(folder: Path, rows: Sequence[Row]) -> None:
    """Where there is a score: the runs in the six columns of the published logs."""
    if any(row.reference_m is None for row in rows) or not rows:
        return
    (folder / LOG).write_text(barn_log(rows, _metric), encoding="utf-8")


def print_figures(figures: dict[str, Any], console: Console) -> None:
    """A line for each cell, one for all of them, and the failures."""
    entry = " ".join(str(figures[key]) for key in ("pilot", "profile", "stress") if figures[key] not in (None, "none"))
    rows = [HEADS, *((name, *_line(cell)) for name, cell in [*figures["cells"].items(), ("all", figures)])]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADS))]
    console.print(f"{figures['suite']}, {entry}", markup=False)
    for row in rows:
        line = "  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True))
        console.print(line, markup=False, soft_wrap=True)
    for failure in figures["failures"]:
        console.print(f"  {failure['world']}, run {failure['run']}: {failure['end']}", markup=False)


def rate(figures: dict[str, Any], name: str) -> str:
    """A fraction with its interval."""
    if figures[name] is None:
        return "-"
    low, high = figures[f"{name}_ci95"]
    return f"{figures[name]:.3f} [{low:.3f}, {high:.3f}]"


def number(value: float | None, decimals: int = 2) -> str:
    """'-' for what is not known."""
    return "-" if value is None else f"{value:.{decimals}f}"


def _line(cell: dict[str, Any]) -> list[str]:
    score = "-" if cell["score_05"] is None else f"{cell['score_05']:.4f} / {cell['score_025']:.4f}"
    return [
        str(cell["runs"]),
        rate(cell, "success"),
        number(cell["collision"], 3),
        number(cell["struck"], 3),
        number(cell["timeout"], 3),
        number(cell["spl"], 3),
        number(cell["mean_time_s"], 1),
        score,
        number(cell["min_clearance_m"], 3),
    ]


def _metric(row: Row) -> float:
    assert row.reference_m is not None  # the log is written only where every run has one
    return barn_score(row.success, row.time_s, row.reference_m, CLIP_05)
