"""``swiftnav clone``: a policy that learns a teacher's ways by flying itself; resumable at any moment."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.cli_options import Json, print_json, refuse_beside_resume, require_extra

if TYPE_CHECKING:
    from mission.training.dagger import Standing

PresetName = Annotated[str, typer.Option("--preset", help="Settings that the other options change: forest, tight.")]
World = Annotated[str | None, typer.Option(help="A mission's world, a world file, or KIND[:SPLIT[:COUNT]].")]
TeacherName = Annotated[str | None, typer.Option("--teacher", help="geometric: the expert; map: who knows the map.")]
Observation = Annotated[str | None, typer.Option(help="What the policy sees: map, corridors, goal, ...")]
Rounds = Annotated[int | None, typer.Option(min=1, max=100, help="Of flying and cloning.")]
Flights = Annotated[int | None, typer.Option(min=1, max=100_000, help="Of a round.")]
Steps = Annotated[int | None, typer.Option(min=1, help="Of a cloning.")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, max=2**31, help="Of worlds, flights and weights.")]
Out = Annotated[Path | None, typer.Option(help="Run folder, new or empty; default below ./runs.")]
Resume = Annotated[Path | None, typer.Option(metavar="DIR", help="Go on with this run; its own settings hold.")]

DEFAULT = "forest"


def clone(
    context: typer.Context,
    preset: PresetName = DEFAULT,
    world: World = None,
    teacher: TeacherName = None,
    observation: Observation = None,
    rounds: Rounds = None,
    flights: Flights = None,
    steps: Steps = None,
    seed: Seed = None,
    out: Out = None,
    resume: Resume = None,
    json: Json = False,
) -> None:
    """Learn a teacher's ways by DAgger: fly, be told at each decision what it would do, clone, repeat."""
    require_extra("train", "clone")
    from mission.training.dagger import run
    from mission.training.dagger_config import clone_preset, read_config, write_config
    from mission.training.training_worlds import world_source

    if resume is not None:
        refuse_beside_resume(context, "json")
        folder, config = resume, read_config(resume)
    else:
        asked: dict[str, Any] = {
            "world": world,
            "teacher": teacher,
            "observation": observation,
            "rounds": rounds,
            "flights": flights,
            "steps": steps,
            "seed": seed,
        }
        config = replace(clone_preset(preset), **{key: value for key, value in asked.items() if value is not None})
        world_source(config.world)  # a mistake is told before a folder is there
        folder = out or Path("runs") / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}_clone"
        write_config(config, folder)
    with _Shown(config.rounds * config.flights, json) as shown:
        learned = run(config, folder, shown.update)
    policy = folder / f"round-{config.rounds - 1}"
    if json:
        figures = {"loss": learned.loss, "held_out_loss": learned.held_out_loss, "agreement": learned.agreement}
        print_json({"folder": str(folder), "policy": str(policy), **figures})
        return
    typer.echo(f"{policy}: same or neighbouring heading as the teacher in {learned.agreement:.0%} of what was held out")


class _Shown:
    """A bar over all flights, and a line after each round."""

    def __init__(self, flights: int, quiet: bool) -> None:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True, highlight=False, quiet=quiet)
        self._progress = Progress(console=console)
        self._task = self._progress.add_task("flights", total=flights)

    def __enter__(self) -> "_Shown":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def update(self, standing: "Standing") -> None:
        """Show how it stands."""
        if standing.clone is None:
            self._progress.update(self._task, advance=1, description=f"round {standing.round}")
            return
        self._progress.console.print(
            f"round {standing.round}: {standing.successes} of {standing.flights} flights arrived,"
            f" {standing.decisions} decisions seen so far, agreement {standing.clone.agreement:.0%}"
        )
