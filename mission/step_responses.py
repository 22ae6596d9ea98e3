"""Do both flight stacks answer steps alike?  ``PX4_BIN=... python -m mission.step_responses --out docs/figures``

Flies four steps with the embedded stack and with a real PX4 on the same physics, draws both, prints rise times and
overshoots. Exit code 0 when they agree within 20 % (an overshoot within 2 % of the step as well).
"""

import argparse
import math
import os
import sys
from pathlib import Path
from typing import Any, Final

from companion.core.types import F64
from mission.errors import FlightError, InputError
from mission.figures_style import GRID_COLOUR, INK, MODE_COLOURS, MUTED
from mission.px4_firmware import find_build
from mission.step_flights import fly_embedded, fly_px4
from mission.step_plan import STEPS, Step, rise_and_overshoot

AGREE: Final = 0.2
AGREE_OVERSHOOT: Final = 0.02  # of the step: next to nothing is next to nothing
FIGURE: Final = "step_responses.png"
LINES: Final[dict[str, dict[str, Any]]] = {  # they lie on each other
    "embedded": {"color": MODE_COLOURS["travel"], "linewidth": 4.0, "alpha": 0.45},
    "PX4 v1.16": {"color": MODE_COLOURS["rl"], "linewidth": 1.4},
}
Tracks = dict[str, F64]


def table(tracks: Tracks) -> tuple[list[str], bool]:
    """Rows of a Markdown table, and whether all agree."""
    rows = ["| step | rise time, s: embedded | PX4 | overshoot, %: embedded | PX4 |", "|---|---|---|---|---|"]
    agree = True
    for step in STEPS:
        (rise_s, over), (px4_s, px4_over) = (rise_and_overshoot(*step.response(track)) for track in tracks.values())
        rows.append(f"| {step.name} | {rise_s:.2f} | {px4_s:.2f} | {over * 100:.1f} | {px4_over * 100:.1f} |")
        agree = agree and math.isclose(rise_s, px4_s, rel_tol=AGREE)
        agree = agree and abs(over - px4_over) <= max(AGREE * px4_over, AGREE_OVERSHOOT)
    return rows, agree


def draw(tracks: Tracks, path: Path) -> None:
    """One panel a step."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    for step, axes in zip(STEPS, figure.subplots(2, 2).flat, strict=True):
        _panel(axes, step, tracks)
    figure.savefig(path, dpi=110)


def _panel(axes: Any, step: Step, tracks: Tracks) -> None:
    scale, unit = (180.0 / math.pi, "deg") if step.unit == "rad" else (1.0, step.unit)
    for level in (0.0, step.size * scale):
        axes.axhline(level, color=MUTED, linewidth=0.8, linestyle="--")
    for name, track in tracks.items():
        t_s, part = step.response(track)
        rise_s, over = rise_and_overshoot(t_s, part)
        label = f"{name}: {rise_s:.2f} s, {over * 100:.0f} % over"
        axes.plot(t_s, part * step.size * scale, label=label, **LINES[name])
    axes.set_title(step.name, color=INK, loc="left", fontsize=11)
    axes.set_xlabel("s since the step")
    axes.set_ylabel(unit)
    axes.grid(color=GRID_COLOUR)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="lower right", frameon=False, fontsize=9)


def main(arguments: list[str] | None = None) -> int:
    """Fly, draw, print."""
    parser = argparse.ArgumentParser(prog="python -m mission.step_responses", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder of the figure")
    parser.add_argument("--instance", type=int, default=0)
    given = parser.parse_args(arguments)
    binary = os.environ.get("PX4_BIN")
    if not binary:
        print("PX4_BIN has to name a build of PX4 1.16: .../px4_sitl_default/bin/px4", file=sys.stderr)
        return 2
    try:
        build = find_build(Path(binary))
        tracks = dict(zip(LINES, (fly_embedded(), fly_px4(build, given.instance)), strict=True))
    except (InputError, FlightError) as error:
        print(error, file=sys.stderr)
        return 2
    given.out.mkdir(parents=True, exist_ok=True)
    draw(tracks, given.out / FIGURE)
    rows, agree = table(tracks)
    print("\n".join(rows))
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
