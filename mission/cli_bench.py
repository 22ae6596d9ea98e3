"""``swiftnav bench``: how quick is it on this machine, and how does it fly where others are measured?"""

from typing import Annotated

import typer

from mission.cli_bench_suites import register
from mission.cli_options import Json, Seed, print_json, require_extra

app = typer.Typer(help="Measurements.")


@app.callback()
def bench() -> None:
    """Measurements; each prints the machine it ran on."""


Policy = Annotated[str | None, typer.Option(help="Who flies in RL mode, instead of the mission's; e.g. geometric.")]


@app.command(epilog="Example: swiftnav bench speed --policy geometric --json")
def speed(policy: Policy = None, seed: Seed = 1, json: Json = False) -> None:
    """Ratios to bare JSBSim stepping, the closed loop over UDP, the ticks, the companion's memory."""
    require_extra("sitl", "bench speed")
    from mission.bench_speed import FIGURES, measure

    figures = measure(seed, policy)
    if json:
        print_json(figures)
        return
    for name, value in figures.items():
        figure = f"{value:.3g}" if isinstance(value, float) else value
        typer.echo(f"{name:17} {figure:>8}  {FIGURES[name]}")


register(app)
