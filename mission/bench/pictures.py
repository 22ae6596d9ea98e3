"""What did a failed run look like? World, track by speed, last scan, last path, where it ended; one picture."""

import io
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mission.bench.course import Course
from mission.bench.flight import Flown
from mission.figures_style import BAD_COLOUR, INK, PROPOSAL_COLOUR
from mission.figures_world import draw_world

DPI = 110
SIDE_IN = 8.0
ROUND_M = 3.0  # shown round the flight


def failure_picture(course: Course, flown: Flown, run: int) -> bytes:
    """The picture as PNG."""
    figure = Figure(figsize=(SIDE_IN, SIDE_IN))
    ax = figure.add_axes((0.08, 0.07, 0.84, 0.84))
    draw_world(ax, course.world, 0.0 if not course.world.movers else float(flown.track[-1, 0]))
    _draw_track(figure, ax, flown)
    ax.scatter(flown.seen_ne_m[:, 1], flown.seen_ne_m[:, 0], s=5, c=INK, lw=0, zorder=6)
    if flown.last.path_ne_m is not None:
        planned = flown.last.path_ne_m + flown.spawn_ned_m[:2]
        ax.plot(planned[:, 1], planned[:, 0], "o-", c=PROPOSAL_COLOUR, lw=1.0, ms=3, zorder=7)
    north_m, east_m = flown.track[-1, 1:3]
    ax.add_patch(Circle((east_m, north_m), course.rules.radius_m, fc="none", ec=BAD_COLOUR, lw=1.5, zorder=8))
    _zoom(ax, course, flown)
    mode = flown.modes[-1]
    title = f"{course.name}, run {run}: {flown.end} after {flown.time_s:.1f} s, {flown.track[-1, 3]:.2f} m/s, {mode}"
    ax.set_title(title, fontsize=10)
    FigureCanvasAgg(figure)
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=DPI, facecolor="white")
    return png.getvalue()


def _draw_track(figure: Figure, ax: Any, flown: Flown) -> None:
    places = flown.track[:, [2, 1]]
    if len(places) < 2:
        return
    pieces = np.stack([places[:-1], places[1:]], axis=1)
    lines = LineCollection(list(pieces), array=flown.track[1:, 3], cmap="viridis", lw=1.8, zorder=4)
    ax.add_collection(lines)
    figure.colorbar(lines, ax=ax, shrink=0.5, label="speed [m/s]")


def _zoom(ax: Any, course: Course, flown: Flown) -> None:
    places = np.concatenate([flown.track[:, 1:3], course.world.start_ned_m[None], course.world.goal_ned_m[None]])
    low, high = places.min(axis=0) - ROUND_M, places.max(axis=0) + ROUND_M
    ax.set_xlim(low[1], high[1])
    ax.set_ylim(low[0], high[0])
