"""What was judged when?  Mode, safety score, nearest obstacle, speed and clearance over vehicle time."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from companion.core.types import F64
from mission.figures_style import BAD_COLOUR, GOOD_COLOUR, GRID_COLOUR, INK, MODE_COLOURS, MODE_LABELS, MUTED
from mission.flight_log import NavigatorLog, TruthLog
from mission.flight_plan import FlightPlan
from mission.judge import Result

SIZE_IN = (11.0, 8.0)
CLEARANCE_SHOWN_M = 5.0
WORD_FITS = 0.06  # of the whole time
Level = tuple[str, float]


def strips(plan: FlightPlan, truth: TruthLog, nav: NavigatorLog, result: Result) -> Figure:
    """The picture, not yet saved."""
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.subplots(5, 1, sharex=True, height_ratios=[0.32, 1, 1, 1, 1])
    arbiter = plan.params.arbiter
    speed = np.hypot(truth.vel_ned_m_s[:, 0], truth.vel_ned_m_s[:, 1])
    clearance = np.where(np.isfinite(truth.clearance_m), truth.clearance_m, np.nan)
    _mode_strip(axes[0], nav)
    _strip(axes[1], nav.t_s, nav.s_fuzzy, "safety score", [("enter", arbiter.s_enter), ("exit", arbiter.s_exit)])
    _strip(axes[2], nav.t_s, nav.d_min_m, "d_min [m]", [("enter", arbiter.d_enter_m), ("exit", arbiter.d_exit_m)])
    _strip(axes[3], truth.t_s, speed, "speed [m/s]", [("cap", plan.mission.cruise_m_s)])
    _strip(axes[4], truth.t_s, clearance, "clearance [m]", [("contact", 0.0)])
    axes[1].set_ylim(0.0, 1.05)
    axes[4].set_ylim(min(-0.15, np.nanmin(clearance, initial=0.0)), CLEARANCE_SHOWN_M)
    for ax in axes[1:]:
        _shade_modes(ax, nav)
    axes[-1].set_xlabel("vehicle time [s]", fontsize=9, color=MUTED)
    if len(truth.t_s):
        axes[-1].set_xlim(truth.t_s[0], truth.t_s[-1])
    figure.suptitle(
        f"{plan.mission.name}  ·  seed {plan.seed}  ·  policy {result.policy}",
        x=0.01,
        ha="left",
        fontsize=12,
        fontweight="bold",
        color=INK,
    )
    colour = GOOD_COLOUR if result.success else BAD_COLOUR
    figure.text(0.99, 0.985, result.reason, fontsize=9, color=colour, ha="right", va="top")
    return figure


def _mode_strip(ax: Any, nav: NavigatorLog) -> None:
    """Coloured bands; a word in each that is wide enough for it."""
    spans = _spans(nav)
    total_s = spans[-1][2] - spans[0][1] if spans else 0.0
    for mode, start_s, end_s in spans:
        ax.axvspan(start_s, end_s, color=MODE_COLOURS[mode], lw=0)
        if end_s - start_s > WORD_FITS * total_s:
            middle_s = (start_s + end_s) / 2
            ax.text(
                middle_s, 0.5, MODE_LABELS[mode], color="white", fontsize=8.5, ha="center", va="center", clip_on=True
            )
    ax.set_yticks([])
    ax.set_ylim(0.0, 1.0)
    ax.set_ylabel("mode", color=INK, fontsize=9)
    _plain(ax)


def _shade_modes(ax: Any, nav: NavigatorLog) -> None:
    for mode, start_s, end_s in _spans(nav):
        if mode != "standby":
            ax.axvspan(start_s, end_s, color=MODE_COLOURS[mode], alpha=0.07, lw=0, zorder=0)


def _strip(ax: Any, t_s: F64, values: F64, label: str, levels: list[Level]) -> None:
    ax.plot(t_s, values, color=INK, lw=1.1)
    for i, (name, level) in enumerate(levels):
        ax.axhline(level, color=MUTED, lw=0.8, ls=(0, (4, 3)))
        side = (2 * i - 1) * 4 if len(levels) > 1 else 0  # two levels may lie close together
        place = {"xy": (1.0, level), "xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        ax.annotate(name, xytext=(4, side), fontsize=7.5, color=MUTED, va="center", **place)
    ax.set_ylabel(label, color=INK, fontsize=9)
    ax.set_ylim(bottom=0.0)
    ax.grid(True, color=GRID_COLOUR, lw=0.6)
    _plain(ax)


def _spans(nav: NavigatorLog) -> list[tuple[str, float, float]]:
    """(mode, from, to) of every unbroken stretch."""
    spans: list[tuple[str, float, float]] = []
    for mode, t_s in zip(nav.mode, nav.t_s.tolist(), strict=True):
        if spans and spans[-1][0] == mode:
            spans[-1] = (mode, spans[-1][1], t_s)
        else:
            start_s = spans[-1][2] if spans else t_s
            spans.append((mode, start_s, t_s))
    return spans


def _plain(ax: Any) -> None:
    ax.tick_params(labelsize=8, colors=MUTED, length=3)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        ax.spines[side].set_color(GRID_COLOUR)
