"""Which pictures lie in every flight folder?  ``top_view.png`` and ``strips.png``.

Drawn without pyplot, so it works on any thread and without a display.
"""

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mission.figures_strips import strips
from mission.figures_top_view import top_view
from mission.flight_log import read_navigator, read_truth
from mission.flight_plan import FlightPlan
from mission.judge import Result

DPI = 130


def draw_flight(plan: FlightPlan, folder: Path, result: Result) -> None:
    """Write both pictures into the flight folder."""
    truth = read_truth(folder / "truth.jsonl")
    nav = read_navigator(folder / "navigator.jsonl", plan.draws.spawn_ned_m)
    _save(top_view(plan, truth, nav, result), folder / "top_view.png")
    _save(strips(plan, truth, nav, result), folder / "strips.png")


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=DPI, facecolor="white")
