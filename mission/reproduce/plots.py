"""What do the paper's figures look like here?  PNG files from the rows of the arms, small enough for a repository.

Curves are 15-episode moving averages: mean over the seeds that are still training while at least half are, band: 95 %
interval of that mean (Student's t) where at least three are, thin lines: each seed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from companion.core.types import F64
from mission.figures_style import BAD_COLOUR, GOOD_COLOUR, GRID_COLOUR, INK, MUTED
from mission.figures_world import draw_world
from mission.reproduce.measures import Interval, SeedRows, over_seeds
from mission.training.figures import GREEDY, POLICY_COLOURS, WINDOW, moving_average, spread_episodes
from sitl.world import World

SWIFT_COLOUR, VANILLA_COLOUR = "#2b6cb0", "#d9580d"
THIRD_COLOUR = "#8a63d2"
DPI = 90
SMALL = {"optimize": True}
PANEL_INCH = (4.4, 2.9)
BAND_SEEDS = 3  # of two the interval is wider than the picture
SHOWN_TRACKS = 10  # of each, over a world

Arm = Sequence[SeedRows]


@dataclass(frozen=True, slots=True)
class Band:
    """One curve over episodes."""

    episode: F64  # (n,)
    mean: F64
    low: F64
    high: F64
    seeds: list[F64]  # smooth, each as long as its seed


def band(seeds: Arm, key: str, window: int = WINDOW) -> Band:
    """A row's number, smooth within each seed, then mean and 95 % interval over seeds; ends when half are done."""
    smooth = [moving_average(np.array([row[key] for row in s.episodes], np.float64), window) for s in seeds]
    smooth = [values for values in smooth if len(values)]
    lengths = sorted((len(values) for values in smooth), reverse=True)
    shown = lengths[(len(lengths) + 1) // 2 - 1] if lengths else 0
    intervals = [over_seeds([float(values[k]) for values in smooth if k < len(values)]) for k in range(shown)]
    known = [interval for interval in intervals if interval is not None]
    known = [i if i.seeds >= BAND_SEEDS else replace(i, low=None, high=None) for i in known]
    mean, low, high = (np.array([pick(interval) for interval in known]) for pick in (lambda i: i.mean, _low, _high))
    return Band(np.arange(1.0, len(known) + 1), mean, low, high, smooth)


def draw_curves(rows: Sequence[tuple[str, Arm]], picture: Path) -> None:
    """Steps and return of each arm, one row an arm (the paper's Fig. perf_both), beside them greedy checkpoints."""
    figure, axes = _panels(len(rows), 4, inch=(3.3, 2.6))
    for (title, seeds), (steps, total, success, ratio) in zip(rows, axes, strict=True):
        _draw_band(steps, band(seeds, "steps"), SWIFT_COLOUR, "steps")
        _draw_band(total, band(seeds, "return"), VANILLA_COLOUR, "return")
        _draw_checkpoints(success, seeds, "success")
        _draw_checkpoints(ratio, seeds, "path_ratio")
        success.set_ylim(-0.03, 1.03)
        if success.get_legend_handles_labels()[0]:
            success.legend(frameon=False, fontsize=8, loc="lower right")
        steps.set_title(title, color=INK, fontsize=10, loc="left")
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def draw_ablations(columns: Sequence[tuple[str, Arm]], picture: Path) -> None:
    """Steps, return and switches with and without, a column each, on shared axes: Fig. ablation."""
    names = (("steps", SWIFT_COLOUR), ("return", VANILLA_COLOUR), ("switches", THIRD_COLOUR))
    figure, axes = _panels(len(names), len(columns), sharey="row")
    for k, (title, seeds) in enumerate(columns):
        for ax, (name, colour) in zip(axes[:, k], names, strict=True):
            _draw_band(ax, band(seeds, name), colour, name if k == 0 else "")
        axes[0, k].set_title(title, color=INK, fontsize=10, loc="left")
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def draw_baseline(swift: Arm, vanilla: Arm, picture: Path) -> None:
    """Share of successes and flown metres per episode over ticks of the environment, a line a seed."""
    figure, axes = _panels(1, 2)
    for ax, label, value in (
        (axes[0, 0], f"success of the last {WINDOW}", lambda row: float(row["success"])),
        (axes[0, 1], f"return, mean of the last {WINDOW}", lambda row: float(row["return"])),
    ):
        for name, seeds, colour in (("SWIFT-Nav", swift, SWIFT_COLOUR), ("vanilla TD3", vanilla, VANILLA_COLOUR)):
            _draw_over_ticks(ax, seeds, value, colour, name)
        _plain(ax, "ticks of the environment", label)
    axes[0, 0].set_ylim(-0.03, 1.03)
    axes[0, 0].legend(frameon=False, fontsize=8, loc="center right")
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def draw_compared(world: World, arms: Sequence[tuple[str, Arm, str]], picture: Path) -> None:
    """Greedy flights of two arms in one world, side by side: Fig. traj1_compare."""
    figure, axes = _panels(1, len(arms), inch=_world_inch(world))
    for ax, (title, seeds, colour) in zip(axes[0], arms, strict=True):
        draw_world(ax, world)
        for seed in seeds:
            for flight in seed.flights[: max(1, SHOWN_TRACKS // len(seeds))]:
                track = np.array(flight["track_ne_m"])
                ax.plot(track[:, 1], track[:, 0], color=colour, lw=1.0, alpha=0.75, zorder=4)
                end = GOOD_COLOUR if flight["success"] else BAD_COLOUR
                ax.plot(track[-1:, 1], track[-1:, 0], "o", color=end, ms=3, zorder=6)
        ax.set_title(title, color=INK, fontsize=10, loc="left")
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def draw_episodes(world: World, arms: Sequence[tuple[str, SeedRows]], picture: Path) -> None:
    """Where one seed flew in episodes from the first to the last: Fig. complex_together."""
    figure, axes = _panels(1, len(arms), inch=_world_inch(world))
    for ax, (title, seed) in zip(axes[0], arms, strict=True):
        draw_world(ax, world)
        shown = [episode for episode in spread_episodes(len(seed.episodes)) if episode in seed.tracks]
        colours = mpl.colormaps["viridis_r"](np.linspace(0.15, 1.0, max(len(shown), 1)))
        for episode, colour in zip(shown, colours, strict=False):
            track = seed.tracks[episode]
            ax.plot(track[:, 1], track[:, 0], color=colour, lw=1.5, zorder=4, label=f"episode {episode}")
        ax.set_title(title, color=INK, fontsize=10, loc="left")
        if shown:
            ax.legend(frameon=False, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=2)
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def draw_arms(figures: Mapping[str, Mapping[str, Interval | None]], picture: Path) -> None:
    """A dot and its interval an arm: episodes to the end, success of the last 50, greedy success and path ratio."""
    columns = (
        ("episodes", "episodes to the end"),
        ("success_last50", "success, last 50"),
        ("greedy_success", "greedy success"),
        ("greedy_path_ratio", "greedy path ratio"),
    )
    figure, axes = _panels(1, len(columns), inch=(2.9, max(1.6, 0.26 * len(figures) + 0.8)), sharey="all")
    names = list(figures)
    for ax, (key, label) in zip(axes[0], columns, strict=True):
        for y, name in enumerate(names):
            interval = figures[name].get(key)
            if interval is not None:
                ax.plot([_low(interval), _high(interval)], [y, y], color=SWIFT_COLOUR, lw=2.0, alpha=0.4)
                ax.plot([interval.mean], [y], "o", color=SWIFT_COLOUR, ms=4)
        _plain(ax, label, "")
        ax.set_yticks(range(len(names)), names, fontsize=8)
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    for ax in axes[0, 1:3]:
        ax.set_xlim(-0.03, 1.03)
    figure.savefig(picture, dpi=DPI, pil_kwargs=SMALL)


def _draw_band(ax: Any, curve: Band, colour: str, label: str) -> None:
    for values in curve.seeds:
        ax.plot(np.arange(1, len(values) + 1), values, color=colour, lw=0.5, alpha=0.35)
    ax.fill_between(curve.episode, curve.low, curve.high, color=colour, alpha=0.2, lw=0)
    ax.plot(curve.episode, curve.mean, color=colour, lw=1.8)
    _plain(ax, "episode", label)


def _draw_checkpoints(ax: Any, seeds: Arm, key: str) -> None:
    """Greedy flights during training, a line a seed; policies that learn nothing as levels."""
    for seed in seeds:
        rows = [row for row in seed.evaluations if row.get(GREEDY, {}).get(key) is not None]
        points = [(row["episode"], row[GREEDY][key]) for row in rows]
        if points:
            ax.plot(*zip(*points, strict=True), color=POLICY_COLOURS[GREEDY], lw=1.0, alpha=0.7, marker="o", ms=2)
    for name, colour in POLICY_COLOURS.items():
        levels = [row[name][key] for seed in seeds for row in seed.evaluations[:1] if name in row]
        levels = [level for level in levels if level is not None]
        if name != GREEDY and levels:
            ax.axhline(float(np.mean(levels)), color=colour, lw=1.2, ls="--", label=name)
    _plain(ax, "episode", f"greedy {key.replace('_', ' ')}")


def _draw_over_ticks(ax: Any, seeds: Arm, value: Callable[[dict[str, Any]], float], colour: str, name: str) -> None:
    for k, seed in enumerate(seeds):
        ticks = np.cumsum([row["ticks"] for row in seed.episodes])
        values = moving_average(np.array([value(row) for row in seed.episodes], np.float64), WINDOW)
        ax.plot(ticks, values, color=colour, lw=1.2, alpha=0.8, label=name if k == 0 else None)


def _low(interval: Interval) -> float:
    return interval.mean if interval.low is None else interval.low


def _high(interval: Interval) -> float:
    return interval.mean if interval.high is None else interval.high


def _world_inch(world: World) -> tuple[float, float]:
    """A panel in the shape of the world."""
    n_min, e_min, n_max, e_max = world.bounds_m
    high = 6.0
    return max(2.6, high * (e_max - e_min) / (n_max - n_min) + 0.6), high


def _panels(rows: int, columns: int, inch: tuple[float, float] = PANEL_INCH, sharey: Any = False) -> tuple[Any, Any]:
    """A figure that needs no display, and its axes (rows, columns)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(inch[0] * columns, inch[1] * rows), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, sharey=sharey)


def _plain(ax: Any, x: str, y: str) -> None:
    ax.set_xlabel(x, color=MUTED)
    ax.set_ylabel(y, color=MUTED)
    ax.grid(color=GRID_COLOUR, lw=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
