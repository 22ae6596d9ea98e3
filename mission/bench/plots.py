"""How does success fall with speed, and where must it? Two pictures with the theory lines drawn in."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from companion.guidance.limits import LimitsParams
from mission.bench import theory
from mission.bench.rows import Row
from mission.bench.scores import by_cell
from mission.figures_style import GRID_COLOUR, INK, MUTED
from mission.rates import wilson

DPI = 110
SEEN_M, HULL_M, TRUNK_M, POLE_M = 6.0, 0.2, 0.3, 0.75
Entries = Mapping[str, Sequence[Row]]


def draw_pole(entries: Entries, path: Path) -> None:
    """Success against speed at the start."""
    figure, ax = _axes("speed at the start [m/s]")
    for name, rows in entries.items():
        _curve(ax, name, rows, lambda cell: float(cell.split()[0]))
    ceiling = theory.evasion_speed(SEEN_M, POLE_M, HULL_M, theory.LATENCY_S)
    _limit(ax, ceiling, "evasion ceiling, 35 deg of tilt")
    _save(figure, ax, path)


def draw_forest(entries: Entries, path: Path) -> None:
    """Success against the cap, one line a density."""
    figure, ax = _axes("speed cap [m/s]")
    for name, rows in entries.items():
        for density in sorted({row.cell.split()[0] for row in rows}):
            chosen = [row for row in rows if row.cell.split()[0] == density]
            _curve(ax, f"{name}, {density}", chosen, lambda cell: float(cell.split()[2]))
    limits = LimitsParams()
    stop = theory.stop_distance_speed(SEEN_M, HULL_M, 0.15, limits.decel_m_s2, limits.tau_s)
    _limit(ax, stop, "stop-distance speed, 6 m seen")
    _limit(ax, theory.evasion_speed(SEEN_M, TRUNK_M, HULL_M, theory.LATENCY_S), "evasion ceiling, one trunk")
    _save(figure, ax, path)


def _axes(label: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(7.0, 4.2))
    ax = figure.add_axes((0.1, 0.14, 0.86, 0.8))
    ax.set_xlabel(label)
    ax.set_ylabel("success")
    ax.set_ylim(-0.03, 1.05)
    ax.grid(color=GRID_COLOUR, lw=0.6)
    return figure, ax


def _curve(ax: Any, label: str, rows: Sequence[Row], speed_of: Callable[[str], float]) -> None:
    cells = by_cell(rows)
    points = []
    for cell, found in cells.items():
        won = sum(row.success for row in found)
        low, high = wilson(won, len(found))
        points.append((speed_of(cell), won / len(found), low, high))
    points.sort()
    speeds, shares, lows, highs = zip(*points, strict=True)
    below = [share - low for share, low in zip(shares, lows, strict=True)]
    above = [high - share for share, high in zip(shares, highs, strict=True)]
    ax.errorbar(speeds, shares, yerr=[below, above], fmt="o-", ms=4, lw=1.2, capsize=2, label=label)


def _limit(ax: Any, speed_m_s: float, label: str) -> None:
    ax.axvline(speed_m_s, color=MUTED, lw=1.0, ls="--")
    ax.text(speed_m_s, 0.02, f" {label}: {speed_m_s:.1f}", rotation=90, va="bottom", ha="right", fontsize=7, color=INK)


def _save(figure: Figure, ax: Any, path: Path) -> None:
    ax.legend(fontsize=7, frameon=False, loc="lower left")
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=DPI, facecolor="white")
