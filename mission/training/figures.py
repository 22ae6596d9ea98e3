"""What did training look like?  The paper's learning curves with bands over seeds, and trajectories over episodes.

Reads the rows of a run folder. Left the 15-episode moving averages of steps and return: mean over seeds, band of one
standard deviation; right, greedy success at checkpoints beside ``straight`` and ``random``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from companion.core.types import F64
from mission.figures_style import GRID_COLOUR, INK, MUTED
from mission.figures_world import draw_world
from mission.flight_log import read_rows
from sitl.world import World

WINDOW = 15  # episodes, as in the paper
CURVE_COLOUR, RETURN_COLOUR = "#2b6cb0", "#d9580d"
GREEDY = "greedy"
POLICY_COLOURS = {GREEDY: "#2f9e44", "straight": "#8a63d2", "random": "#9aa0a6"}
PANEL_INCH = (4.6, 3.2)
DPI = 130


@dataclass(frozen=True, slots=True)
class Curve:
    """One figure over episodes: mean and spread over the seeds that got that far."""

    episode: F64  # (n,)
    mean: F64
    low: F64  # mean minus one standard deviation
    high: F64


def read_seeds(folder: Path, name: str = "episodes") -> list[list[dict[str, Any]]]:
    """The rows of every seed of a run, in the order of the seeds."""
    folders = sorted(folder.glob("seed_*"), key=lambda path: int(path.name.removeprefix("seed_")))
    return [list(read_rows(path / f"{name}.jsonl")) for path in folders]


def learning_curve(seeds: Sequence[Sequence[dict[str, Any]]], key: str, window: int = WINDOW) -> Curve:
    """Moving average of a row's number within each seed, then mean and band over seeds."""
    smooth = [moving_average(np.array([row[key] for row in rows], np.float64), window) for rows in seeds if rows]
    longest = max((len(values) for values in smooth), default=0)
    table = np.full((len(smooth), longest), np.nan)
    for row, values in zip(table, smooth, strict=True):
        row[: len(values)] = values
    counts = np.sum(~np.isnan(table), axis=0)
    mean = np.nansum(table, axis=0) / counts
    spread = np.sqrt(np.nansum((table - mean) ** 2, axis=0) / counts)
    return Curve(np.arange(1.0, longest + 1), mean, mean - spread, mean + spread)


def moving_average(values: F64, window: int) -> F64:
    """Mean of the last ``window`` values, of fewer at the start."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    last = np.arange(1, len(values) + 1)
    first = np.maximum(last - window, 0)
    means: F64 = (sums[last] - sums[first]) / (last - first)
    return means


def draw_learning(folder: Path, picture: Path, title: str) -> None:
    """Steps, return and greedy success of a run, side by side, into a PNG file."""
    figure, axes = _panels(3, PANEL_INCH)
    seeds = read_seeds(folder)
    draw_curve(axes[0], learning_curve(seeds, "steps"), CURVE_COLOUR, "steps")
    draw_curve(axes[1], learning_curve(seeds, "return"), RETURN_COLOUR, "return")
    draw_evaluations(axes[2], read_seeds(folder, "evaluations"))
    figure.suptitle(f"{title}; seeds: {len(seeds)}; {WINDOW}-episode means", color=INK, x=0.01, ha="left", fontsize=11)
    figure.savefig(picture, dpi=DPI)


def draw_curve(ax: Any, curve: Curve, colour: str, label: str) -> None:
    """One curve with its band."""
    ax.fill_between(curve.episode, curve.low, curve.high, color=colour, alpha=0.18, lw=0)
    ax.plot(curve.episode, curve.mean, color=colour, lw=1.6, label=label)
    _plain_axes(ax, "episode", label)


def draw_evaluations(ax: Any, seeds: Sequence[Sequence[dict[str, Any]]]) -> None:
    """Greedy success at checkpoints: a thin line a seed, a thick one for their mean; the baselines as levels."""
    for rows in seeds:
        greedy = [(row["episode"], row[GREEDY]["success"]) for row in rows if GREEDY in row]
        if greedy:
            ax.plot(*zip(*greedy, strict=True), color=POLICY_COLOURS[GREEDY], lw=0.7, alpha=0.5)
    for name, colour in POLICY_COLOURS.items():
        points = [(row["episode"], row[name]["success"]) for rows in seeds for row in rows if name in row]
        if not points:
            continue
        episodes = sorted({episode for episode, _ in points})
        means = [float(np.mean([share for at, share in points if at == episode])) for episode in episodes]
        if name == GREEDY:
            ax.plot(episodes, means, color=colour, lw=1.8, marker="o", ms=3, label=name)
        else:
            ax.axhline(float(np.mean(means)), color=colour, lw=1.2, ls="--", label=name)
    ax.set_ylim(-0.03, 1.03)
    _plain_axes(ax, "episode", "greedy success")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=8, loc="lower right")


def draw_trajectories(folder: Path, seed: int, world: World, picture: Path, episodes: Sequence[int]) -> None:
    """Where a seed flew in these episodes (those that were not flown are left out), early ones pale."""
    figure, (ax,) = _panels(1, (5.0, 7.0))
    draw_world(ax, world)
    rows = {row["episode"]: row["track_ne_m"] for row in read_rows(folder / f"seed_{seed}" / "tracks.jsonl")}
    shown = [episode for episode in episodes if episode in rows]
    colours = mpl.colormaps["viridis_r"](np.linspace(0.1, 0.95, max(len(shown), 1)))
    for episode, colour in zip(shown, colours, strict=False):
        track = np.array(rows[episode])
        ax.plot(track[:, 1], track[:, 0], color=colour, lw=1.5, zorder=4, label=f"episode {episode}")
    ax.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(picture, dpi=DPI)


def spread_episodes(last: int, count: int = 4) -> list[int]:
    """``count`` episodes from the first to the ``last``, evenly."""
    return sorted({round(e) for e in np.linspace(1, last, count)}) if last else []


def _panels(count: int, inch: tuple[float, float]) -> tuple[Any, Any]:
    """A figure that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(inch[0] * count, inch[1]), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(1, count, squeeze=False)[0]


def _plain_axes(ax: Any, x: str, y: str) -> None:
    ax.set_xlabel(x, color=MUTED)
    ax.set_ylabel(y, color=MUTED)
    ax.grid(color=GRID_COLOUR, lw=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
