"""``swiftnav worlds``: which worlds are there, what stands in one, and a new forest from a seed."""

from pathlib import Path
from typing import Annotated, Any

import typer

from mission.cli_options import Json, Seed, print_json, require_extra
from mission.errors import InputError

app = typer.Typer(help="Worlds to fly in.")


@app.command("list", epilog="Example: swiftnav worlds list")
def list_worlds(json: Json = False) -> None:
    """Print the worlds that come with the package."""
    require_extra("sitl", "worlds")
    from mission.world_file import list_worlds as names

    if json:
        print_json([_facts(name) for name in names()])
        return
    for name in names():
        facts = _facts(name)
        counts = ", ".join(f"{facts[kind]} {kind}" for kind in ("cylinders", "boxes", "movers") if facts[kind])
        typer.echo(f"{name:20} {facts['distance_m']:5.1f} m start to goal   {counts or 'empty'}")


@app.command(epilog="Example: swiftnav worlds show trajectory2 --picture trajectory2.png")
def show(
    world: Annotated[str, typer.Argument(help="A name from 'worlds list', or a YAML file.")],
    picture: Annotated[Path | None, typer.Option(help="Write a top view to this PNG file.")] = None,
    json: Json = False,
) -> None:
    """Print what stands in a world; it is checked for a free way from start to goal."""
    require_extra("sitl", "worlds")
    from mission.world_file import load_world

    facts = _facts(world)
    if picture is not None:
        _draw(load_world(world), picture)
    if json:
        print_json(facts)
        return
    for key, value in facts.items():
        typer.echo(f"{key:16} {value}")


@app.command(epilog="Example: swiftnav worlds generate --seed 7 --density 0.05 --out forest7.yaml")
def generate(
    seed: Seed = 0,
    density: Annotated[float, typer.Option(help="Trees per m2.")] = 0.05,
    size: Annotated[tuple[float, float], typer.Option(help="North and east extent, m.")] = (60.0, 40.0),
    trunk: Annotated[float, typer.Option(help="Diameter of a trunk, m.")] = 0.6,
    out: Annotated[Path | None, typer.Option(help="World file to write; left out: printed.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a top view to this PNG file.")] = None,
    json: Json = False,
) -> None:
    """Draw a random forest from a seed; the same seed gives the same forest."""
    require_extra("sitl", "worlds")
    from mission.world_file import world_hash, world_yaml
    from mission.world_generator import generate_forest

    forest = generate_forest(seed, density, size, trunk)
    text = world_yaml(forest)
    if out is not None:
        _write(out, text)
    if picture is not None:
        _draw(forest, picture)
    if json:
        print_json({**_described(forest), "sha256": world_hash(forest), "file": str(out) if out else None})
    elif out is None:
        typer.echo(text, nl=False)
    else:
        typer.echo(f"{out}: {len(forest.circles)} trunks, sha256 {world_hash(forest)}")


def _facts(name_or_path: str) -> dict[str, Any]:
    from mission.world_file import load_world, world_hash

    world = load_world(name_or_path)
    return {**_described(world), "sha256": world_hash(world)}


def _described(world: Any) -> dict[str, Any]:
    n_min, e_min, n_max, e_max = world.bounds_m
    start, goal = world.start_ned_m, world.goal_ned_m
    return {
        "name": world.name,
        "start_ned_m": start.tolist(),
        "goal_ned_m": goal.tolist(),
        "distance_m": float(((goal - start) ** 2).sum() ** 0.5),
        "north_m": [n_min, n_max],
        "east_m": [e_min, e_max],
        "cylinders": len(world.circles),
        "boxes": len(world.boxes),
        "movers": len(world.movers),
    }


def _draw(world: Any, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from mission.figures_world import draw_world

    figure = Figure(figsize=(9.0, 9.0), layout="constrained")
    FigureCanvasAgg(figure)
    draw_world(figure.add_subplot(), world)
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise InputError(f"picture '{path}' cannot be written: {error}") from error


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"world file '{path}' cannot be written: {error.strerror or error}") from error
