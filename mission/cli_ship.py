"""``swiftnav ship``: a trained seed becomes a policy that ``fly`` knows by name."""

from pathlib import Path
from typing import Annotated

import typer

from mission.cli_options import Json, print_json, require_extra

Run = Annotated[Path, typer.Argument(help="Folder of a run of 'swiftnav train'.")]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**31, help="Whose policy.")]
Name = Annotated[str, typer.Option("--name", metavar="NAME", help="Under which it is shipped.")]
Episodes = Annotated[int, typer.Option("--episodes", min=1, max=100_000, help="Flights with guard off and on, each.")]
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]

SHOWN = ("success", "contact", "arrived", "arrived_path_ratio", "arrived_time_s", "switches_max")


def ship(run: Run, seed: Seed, name: Name, episodes: Episodes = 100, jobs: Jobs = 1, json: Json = False) -> None:
    """Fly a seed's policy over whole missions, guard off and on, and ship it with these figures on its card."""
    require_extra("train", "ship")
    from mission.training.ship import Shipment, ship

    evaluation = ship(Shipment(run, seed, name, episodes, jobs), _tell)
    if json:
        print_json(evaluation)
        return
    for flown, figures in evaluation.items():
        told = ", ".join(f"{key} {figures[key]:.3g}" for key in SHOWN if figures[key] is not None)
        typer.echo(f"{flown}: {told}")


def _tell(name: str, count: int) -> None:
    typer.echo(f"{name}: {count} flights", err=True)
