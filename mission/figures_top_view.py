"""Which way did the vehicle take?  World, true path coloured by mode, proposals, setpoints; world ned, north up."""

import textwrap
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mission.figures_style import BAD_COLOUR, GOOD_COLOUR, INK, MODE_COLOURS, MODE_LABELS, MUTED, PROPOSAL_COLOUR
from mission.figures_world import GOAL_COLOUR, START_COLOUR, draw_world
from mission.flight_log import NavigatorLog, TruthLog
from mission.flight_plan import FlightPlan
from mission.judge import Result

LONG_SIDE_IN = 9.5  # of the map itself
LEFT_IN, BOTTOM_IN, TOP_IN = 0.7, 0.6, 0.25  # round the map
PANEL_GAP_IN, PANEL_IN = 0.3, 3.3  # the column of text on its right
LINE_IN = 0.21
WIDE_WORLD_M = 150.0  # of a wider one only what was flown through is shown
ROUND_FLIGHT_M = 6.0

Extent = tuple[float, float, float, float]  # north min, east min, north max, east max


def top_view(plan: FlightPlan, truth: TruthLog, nav: NavigatorLog, result: Result) -> Figure:
    """The picture, not yet saved."""
    shown = _shown_m(plan, truth)
    figure, ax = _map_axes(shown)
    window = truth.t_s[truth.flown]
    draw_world(ax, plan.world, float(window[-1]) if len(window) else 0.0)
    ax.set_ylim(shown[0], shown[2])
    ax.set_xlim(shown[1], shown[3])
    ax.tick_params(labelsize=8, colors=MUTED, length=3)
    ax.set_xlabel("east [m]", fontsize=9, color=MUTED)
    ax.set_ylabel("north [m]", fontsize=9, color=MUTED)
    _draw_proposals(ax, nav)
    _draw_path(ax, truth, nav)
    _draw_setpoints(ax, nav)
    _scale_bar(ax, shown)
    _panel(figure, ax, plan, result, nav)
    return figure


def _draw_proposals(ax: Any, nav: NavigatorLog) -> None:
    proposals = [d.proposal_ned_m[:, ::-1] for d in nav.decisions if d.proposal_ned_m is not None]
    accepted = [d.path_ned_m[:, ::-1] for d in nav.decisions if d.path_ned_m is not None]
    ax.add_collection(LineCollection(proposals, colors=PROPOSAL_COLOUR, lw=0.7, alpha=0.35, zorder=2.5))
    ax.add_collection(LineCollection(accepted, colors=PROPOSAL_COLOUR, lw=0.9, alpha=0.25, ls=":", zorder=2.5))


def _draw_setpoints(ax: Any, nav: NavigatorLog) -> None:
    steered = np.array([mode != "standby" for mode in nav.mode], dtype=bool)
    north_m, east_m = nav.setpoint_ned_m[steered, 0], nav.setpoint_ned_m[steered, 1]
    ax.scatter(east_m, north_m, s=1.2, c=INK, lw=0, alpha=0.5, zorder=4)


def _draw_path(ax: Any, truth: TruthLog, nav: NavigatorLog) -> None:
    """The true path, coloured by the navigator's mode at the time."""
    if len(truth.t_s) < 2 or not nav.mode:
        return
    at = np.clip(np.searchsorted(nav.t_s, truth.t_s[:-1] + 1e-6) - 1, 0, len(nav.mode) - 1)
    points = truth.pos_ned_m[:, 1::-1]
    segments = np.stack([points[:-1], points[1:]], axis=1)
    colours = [MODE_COLOURS[nav.mode[i]] for i in at]
    ax.add_collection(LineCollection(list(segments), colors="white", lw=4.4, alpha=0.85, zorder=3.4, capstyle="round"))
    ax.add_collection(LineCollection(list(segments), colors=colours, lw=2.8, zorder=3.5, capstyle="round"))
    ax.scatter(points[:1, 0], points[:1, 1], marker="o", s=26, fc="white", ec=MODE_COLOURS["standby"], lw=1.4, zorder=6)
    ax.scatter(points[-1:, 0], points[-1:, 1], marker="x", s=34, c=INK, lw=1.6, zorder=6)


def _scale_bar(ax: Any, shown_m: Extent) -> None:
    n_min, e_min, n_max, e_max = shown_m
    length_m = 10.0 if e_max - e_min >= 25.0 else 5.0
    pad_m = 0.012 * max(n_max - n_min, e_max - e_min)
    east_m, north_m = e_max - length_m - 3 * pad_m, n_min + 3 * pad_m
    ax.plot([east_m, east_m + length_m], [north_m, north_m], color=INK, lw=2.0, zorder=7, solid_capstyle="butt")
    label = ax.text(east_m + length_m / 2, north_m + pad_m / 2, f"{length_m:g} m", ha="center", va="bottom", zorder=7)
    label.set(fontsize=8, color=INK, bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 1.0})


def _panel(figure: Figure, ax: Any, plan: FlightPlan, result: Result, nav: NavigatorLog) -> None:
    """Verdict, figures and legend in the column on the right."""
    place, line = ax.get_position(), LINE_IN / figure.get_figheight()
    left, y = place.x1 + PANEL_GAP_IN / figure.get_figwidth(), place.y1
    column = left + 0.95 / figure.get_figwidth()
    reason = textwrap.fill(result.reason, 38)
    verdict, colour = ("success", GOOD_COLOUR) if result.success else ("failure", BAD_COLOUR)
    figure.text(left, y, plan.mission.name, fontsize=15, fontweight="bold", color=INK, va="top")
    figure.text(left, y - 1.5 * line, f"seed {plan.seed}  ·  policy {result.policy}", fontsize=9, color=MUTED, va="top")
    figure.text(left, y - 3.2 * line, verdict, fontsize=11, fontweight="bold", color=colour, va="top")
    figure.text(left, y - 4.3 * line, reason, fontsize=9, color=INK, va="top", linespacing=1.35)
    y -= (6.0 + reason.count("\n")) * line
    for label, value in _figures_of(result):
        figure.text(left, y, label, fontsize=9, color=MUTED, va="top")
        figure.text(column, y, value, fontsize=9, color=INK, va="top")
        y -= line
    anchor = (left - 0.08 / figure.get_figwidth(), y - line / 2)
    handles = _legend(nav)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=anchor, frameon=False, fontsize=9, labelcolor=INK)


def _figures_of(result: Result) -> list[tuple[str, str]]:
    ratio = "" if result.path_ratio is None else f"  ({result.path_ratio:.2f} of the shortest)"
    rows = [
        ("time", f"{result.time_s:.1f} s"),
        ("path", f"{result.path_m:.1f} m{ratio}"),
        ("clearance", "" if result.min_clearance_m is None else f"{result.min_clearance_m:.2f} m at the least"),
        ("landing", "" if result.landing_error_m is None else f"{result.landing_error_m:.2f} m off"),
        ("switches", f"{result.switches} of at most {result.switches_bound}"),
        ("decisions", f"{result.rl_decisions}"),
    ]
    return [row for row in rows if row[1]]


def _legend(nav: NavigatorLog) -> list[Line2D]:
    lines = [Line2D([], [], color=MODE_COLOURS[m], lw=2.6, label=MODE_LABELS[m]) for m in MODE_COLOURS if m in nav.mode]
    if nav.decisions:
        lines.append(Line2D([], [], color=PROPOSAL_COLOUR, lw=1.0, label="proposals"))
        lines.append(Line2D([], [], color=PROPOSAL_COLOUR, lw=1.0, ls=":", label="accepted by the checker"))
    ring = MODE_COLOURS["standby"]
    return [
        *lines,
        Line2D([], [], color=INK, ls="", marker=".", ms=3, label="setpoints"),
        Line2D([], [], color=START_COLOUR, ls="", marker="o", ms=7, mec="white", label="start of the world"),
        Line2D([], [], color="white", ls="", marker="o", ms=5, mec=ring, mew=1.4, label="take-off of this seed"),
        Line2D([], [], color=GOAL_COLOUR, ls="", marker="*", ms=11, mec="white", label="goal"),
        Line2D([], [], color=INK, ls="", marker="x", ms=6, mew=1.6, label="end"),
    ]


def _shown_m(plan: FlightPlan, truth: TruthLog) -> Extent:
    """The world's bounds; of a wide one only what was flown through."""
    n_min, e_min, n_max, e_max = plan.world.bounds_m
    if max(n_max - n_min, e_max - e_min) <= WIDE_WORLD_M:
        return n_min - 1.0, e_min - 1.0, n_max + 1.0, e_max + 1.0
    ends = np.stack([plan.world.start_ned_m, plan.world.goal_ned_m])
    points = np.concatenate([truth.pos_ned_m[:, :2], ends])
    low, high = points.min(axis=0), points.max(axis=0)
    pad = np.maximum(ROUND_FLIGHT_M, (0.3 * np.max(high - low) - (high - low)) / 2)  # no sliver of a straight flight
    return (*(low - pad).tolist(), *(high + pad).tolist())


def _map_axes(shown_m: Extent) -> tuple[Figure, Any]:
    """A figure whose map has the world's proportions, with room for the panel on its right."""
    north_m, east_m = shown_m[2] - shown_m[0], shown_m[3] - shown_m[1]
    scale = LONG_SIDE_IN / max(north_m, east_m)
    width_in = east_m * scale + LEFT_IN + PANEL_GAP_IN + PANEL_IN
    height_in = max(north_m * scale, PANEL_IN) + BOTTOM_IN + TOP_IN
    figure = Figure(figsize=(width_in, height_in))
    size = (east_m * scale / width_in, north_m * scale / height_in)
    return figure, figure.add_axes((LEFT_IN / width_in, 1.0 - TOP_IN / height_in - size[1], *size))
