"""``swiftnav ship-clone``: what was learned in random worlds becomes a policy that ``fly`` knows by name."""

from pathlib import Path
from typing import Annotated

import typer

from mission.cli_options import Json, print_json, require_extra

Run = Annotated[Path, typer.Argument(help="Folder of a run of 'swiftnav clone', or of a seed of 'swiftnav train'.")]
Name = Annotated[str, typer.Option("--name", metavar="NAME", help="Under which it is shipped.")]
Worlds = Annotated[str | None, typer.Option(help="Kinds of worlds to fly in, by commas; default: the table's nine.")]
Episodes = Annotated[int, typer.Option("--episodes", min=1, max=100_000, help="Flights in each, guard off.")]
Beside = Annotated[int, typer.Option("--beside", min=1, max=100_000, help="... guard on, and of the expert.")]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**31, help="Number of the first test world.")]
Into = Annotated[Path | None, typer.Option(help="Where to; default: the package's own policies.")]

SHOWN = ("success", "contact", "path_ratio", "time_s", "min_clearance_m", "guarded")


def ship_clone(
    run: Run,
    name: Name = "forest",
    worlds: Worlds = None,
    episodes: Episodes = 20,
    beside: Beside = 20,
    seed: Seed = 100,
    into: Into = None,
    json: Json = False,
) -> None:
    """Fly a policy in unseen worlds, guard off and on, beside the expert; ship it with these figures on its card."""
    require_extra("train", "ship-clone")
    from companion.policy.store import POLICIES
    from mission.training.ship_clone import WORLDS, CloneShipment
    from mission.training.ship_clone import ship_clone as ship

    kinds = tuple(worlds.split(",")) if worlds else WORLDS
    evaluation = ship(CloneShipment(run, name, kinds, episodes, beside, seed, into or POLICIES), _tell)
    if json:
        print_json(evaluation)
        return
    for world, arms in evaluation.items():
        for arm, figures in arms.items():
            told = ", ".join(f"{key} {figures[key]:.3g}" for key in SHOWN if figures[key] is not None)
            typer.echo(f"{world}, {arm}: {told}")


def _tell(count: int, planned: int) -> None:
    if count % 10 == 0:
        typer.echo(f"flight {count} of {planned}", err=True)
