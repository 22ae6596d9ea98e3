"""``swiftnav train``: a policy learned over several seeds, watched live, resumable at any moment."""

from pathlib import Path
from typing import Annotated, Any

import typer

from mission.cli_options import Json, parse_overrides, print_json, refuse_beside_resume, require_extra
from mission.cluster import check_address
from mission.errors import FlightError

World = Annotated[str | None, typer.Option(help="A mission's world, a world file, or KIND[:SPLIT[:COUNT]].")]
PresetName = Annotated[str, typer.Option("--preset", help="A name, or a YAML file.")]
Seeds = Annotated[int, typer.Option("--seeds", min=1, max=1000, help="How many.")]
FirstSeed = Annotated[int, typer.Option("--seed", min=0, max=2**31, help="The first; then one up each.")]
Successes = Annotated[int, typer.Option("--until-successes", min=1, help="A seed ends with this many ...")]
Episodes = Annotated[int, typer.Option("--max-episodes", min=1, help="... or with this many episodes.")]
Jobs = Annotated[int | None, typer.Option(min=1, max=256, help="Seeds at once; default: one a core.")]
Out = Annotated[Path | None, typer.Option(help="Run folder, new or empty; default below ./runs.")]
Resume = Annotated[Path | None, typer.Option(metavar="DIR", help="Go on with this run; its own settings hold.")]
Device = Annotated[str, typer.Option(help="Where torch computes: cpu, cuda, ...")]
Cluster = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Train on this Ray cluster; 'local': a Ray here.")]
Setting = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="SECTION.FIELD=VALUE", help="Change one setting of the preset; repeatable."),
]

DEFAULT_WORLD = "trajectory1"
COLUMNS = (
    ("seed", "seed"),
    ("state", "state"),
    ("episodes", "episodes"),
    ("successes", "successes"),
    ("greedy success", "greedy_success"),
    ("path ratio", "greedy_path_ratio"),
    ("decisions/s", "decisions_per_s"),
    ("wall s", "wall_s"),
)


def train(
    context: typer.Context,
    world: World = None,
    preset: PresetName = "default",
    seeds: Seeds = 5,
    seed: FirstSeed = 1,
    until_successes: Successes = 100,
    max_episodes: Episodes = 1000,
    setting: Setting = None,
    jobs: Jobs = None,
    out: Out = None,
    resume: Resume = None,
    device: Device = "cpu",
    cluster: Cluster = None,
    json: Json = False,
) -> None:
    """Train several seeds at once until each has its successes. Exit code 0 only if every seed got to its end."""
    require_extra("train", "train")
    if cluster is not None:
        require_extra("scale", "train --cluster")
        check_address(cluster)
    from mission.training.fleet import cores
    from mission.training.fleet_view import FleetView
    from mission.training.presets import load_preset
    from mission.training.run_folder import RunSpec, make_run, open_run
    from mission.training.run_report import run_report
    from mission.training.seed_job import check, train_fleet
    from mission.training.until import Until

    if resume is not None:
        refuse_beside_resume(context, "jobs", "cluster", "json")
        folder, spec = resume, open_run(resume)
    else:
        chosen = load_preset(preset, parse_overrides(None, setting, "--set", "SECTION.FIELD=VALUE"))
        numbers = tuple(range(seed, seed + seeds))
        until = Until(until_successes, max_episodes)
        spec = RunSpec(world or DEFAULT_WORLD, chosen, numbers, until, device)
        check(spec)
        folder = make_run(spec, out)
    asked = f"seeds: {len(spec.seeds)}, each until {spec.until.successes} successes"
    title = f"{spec.world}, preset {spec.preset.name}, {asked}"
    with FleetView(title, quiet=json) as view:
        members = train_fleet(spec, folder, jobs or cores(), cluster, view.update)
    troubles = [f"seed {member.seed}: {member.error}" for member in members if member.state == "failed"]
    try:
        report = run_report(spec, folder, members)
    except OSError as error:  # the disk is full
        troubles.append(f"the report: {error.strerror or error}")
    else:
        print_json(report) if json else _print(report)
    if troubles:
        raise FlightError(f"{'; '.join(troubles)}; 'swiftnav train --resume {folder}' goes on")


def _print(report: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table()
    for name, _ in COLUMNS:
        table.add_column(name, justify="left" if name == "state" else "right")
    for row in report["seeds"]:
        table.add_row(*(_cell(row.get(key)) for _, key in COLUMNS))
    console.print(table)
    shares = ", ".join(f"{name} {share:.0%}" for name, share in report["wall_shares"].items())
    console.print(f"wall time: {shares}", markup=False)
    console.print(f"run folder: {report['folder']}", markup=False)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)
