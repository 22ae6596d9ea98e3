"""``swiftnav bench SUITE``: fly a suite with one pilot, or every suite with every pilot; resumable."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from mission.cli_options import Json, ParamSet, parse_overrides, parse_switch, print_json, require_extra
from mission.cluster import check_address

OUT = Path("bench")
DEFAULT = "geometric"
SUITES = {
    "tracks": "The two trajectories of the paper.",
    "forest": "Poisson forests of three densities at five speeds (Loquercio et al.).",
    "gap": "A narrow gap in a wide wall (Loquercio et al.).",
    "pole": "A pole ahead of a vehicle at speed (Loquercio et al.).",
    "dynamic": "20 x 20 m: 70 standing, 60 moving, or 20 and 40.",
    "heldout": "Fifty frozen worlds of our own cellular automaton, under BARN's rules.",
}

Worlds = Annotated[Path | None, typer.Option("--worlds", metavar="FOLDER", help="BARN's worlds and reference paths.")]
Part = Annotated[str, typer.Option("--part", help="Of BARN's worlds: all, tuning, or kept (never tuned on).")]
PilotName = Annotated[str, typer.Option("--pilot", help="Who flies; 'all': every pilot in turn.")]
Runs = Annotated[int | None, typer.Option("--runs", min=1, help="Of each cell; default: the suite's own number.")]
CellText = Annotated[str, typer.Option("--cell", metavar="TEXT", help="Only cells with this in their names.")]
Jobs = Annotated[int, typer.Option("--jobs", min=1, max=256, help="Processes.")]
Cluster = Annotated[str | None, typer.Option(metavar="ADDRESS", help="Fly on this Ray cluster; 'local': a Ray here.")]
StressName = Annotated[str, typer.Option("--stress", help="noise, dropouts, latency, gusts, drift, blind; or none.")]
Guard = Annotated[str, typer.Option("--guard", help="off: a learned policy flies without the expert beside it.")]
Profile = Annotated[str | None, typer.Option("--profile", help="A named parameter set of the companion.")]
Out = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Runs that lie there are not flown again.")]
Stiff = Annotated[bool, typer.Option("--stiff", help="A vehicle with a stiff velocity loop instead of PX4's gains.")]


@dataclass(frozen=True, slots=True)
class Asked:
    """What every suite can be asked for."""

    pilot: str
    runs: int | None
    cell: str
    jobs: int
    cluster: str | None
    stress: str
    guard: str
    profile: str | None
    param: list[str] | None
    stiff: bool
    out: Path
    json: bool


def register(app: typer.Typer) -> None:
    """One command a suite, one for all of them, one that writes the report."""
    for name, text in SUITES.items():
        app.command(name, help=text, epilog=f"Example: swiftnav bench {name} --pilot geometric --runs 20 --jobs 2")(
            _command(name)
        )
    app.command(epilog="Example: swiftnav bench barn ~/BARN_dataset --runs 150 --jobs 2 --json")(barn)
    app.command("all", epilog="Example: swiftnav bench all --worlds ~/BARN_dataset --jobs 2")(all_suites)
    app.command(epilog="Example: swiftnav bench report --out bench --document docs/benchmarks.md")(report)


def _command(name: str) -> Any:
    def fly(
        pilot: PilotName = DEFAULT,
        runs: Runs = None,
        cell: CellText = "",
        jobs: Jobs = 1,
        cluster: Cluster = None,
        stress: StressName = "none",
        guard: Guard = "on",
        profile: Profile = None,
        param: ParamSet = None,
        stiff: Stiff = False,
        out: Out = OUT,
        json: Json = False,
    ) -> None:
        asked = Asked(pilot, runs, cell, jobs, cluster, stress, guard, profile, param, stiff, out, json)
        _fly(name, None, "all", asked)

    return fly


def barn(
    worlds: Annotated[Path, typer.Argument(metavar="FOLDER", help="Holds world_<i>.world and path_<i>.npy.")],
    part: Part = "all",
    pilot: PilotName = DEFAULT,
    runs: Runs = None,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    stress: StressName = "none",
    guard: Guard = "on",
    profile: Profile = None,
    param: ParamSet = None,
    stiff: Stiff = False,
    out: Out = OUT,
    json: Json = False,
) -> None:
    """BARN's worlds, one to one, by BARN's formula."""
    _fly("barn", worlds, part, Asked(pilot, runs, "", jobs, cluster, stress, guard, profile, param, stiff, out, json))


def all_suites(
    worlds: Worlds = None,
    part: Part = "all",
    pilot: PilotName = "all",
    runs: Runs = None,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    guard: Guard = "on",
    profile: Profile = None,
    param: ParamSet = None,
    stiff: Stiff = False,
    out: Out = OUT,
    json: Json = False,
) -> None:
    """Every suite with every pilot; BARN only with --worlds."""
    require_extra("sitl", "bench all")
    names = [*SUITES, *(["barn"] if worlds is not None else [])]
    if worlds is not None:
        from mission.bench.run import SuiteSpec

        SuiteSpec("barn", worlds, part).load()  # hours before its turn
    for name in names:
        _fly(name, worlds, part, Asked(pilot, runs, "", jobs, cluster, "none", guard, profile, param, stiff, out, json))


def report(
    out: Out = OUT,
    document: Annotated[Path, typer.Option("--document", metavar="FILE", help="Markdown; pictures beside it.")] = (
        Path("docs/benchmarks.md")
    ),
) -> None:
    """Write every table from what was flown, beside the published figures."""
    require_extra("sitl", "bench report")
    from mission.bench.document import write_document

    write_document(out, document)


def _fly(suite: str, worlds: Path | None, part: str, asked: Asked) -> None:
    """Fly what is missing of a suite, pilot by pilot, and say what came out."""
    require_extra("sitl", f"bench {suite}")
    if asked.cluster is not None:
        require_extra("scale", f"bench {suite} --cluster")
        check_address(asked.cluster)
    from rich.console import Console
    from rich.progress import track

    from mission.bench.course import STIFF
    from mission.bench.entry import Entry
    from mission.bench.report import figures_of, print_figures, write_log
    from mission.bench.run import SuiteSpec, entry_folder, fly_missing, missing, read_entry, read_rows
    from mission.bench.stress import stress_named
    from mission.pilots.registry import pilot_named, pilot_names

    console = Console(stderr=asked.json, highlight=False)
    overrides = parse_overrides(None, asked.param)
    stress, guard = stress_named(asked.stress), parse_switch(asked.guard, "--guard")
    pilots = pilot_names() if asked.pilot == "all" else [pilot_named(asked.pilot).name]
    spec = SuiteSpec(suite, worlds, part)
    made = spec.load().only(asked.cell)
    for skipped in made.skipped:
        console.print(f"skipped {skipped.name}: {skipped.reason}", markup=False)
    for pilot in pilots:
        entry = Entry(pilot, asked.profile, stress.name, guard, overrides, dict(STIFF) if asked.stiff else {})
        entry.params_for(made.cells[0].course(0))  # a wrong parameter is refused before anything flies
        folder = entry_folder(asked.out, spec, entry)
        flying = fly_missing(spec, made, entry, folder, asked.runs, asked.jobs, asked.cluster)
        total = len(missing(made, asked.runs, read_entry(folder)))
        for _ in track(flying, f"{suite} {folder.name}", total, console=console):
            pass
        flown = read_rows(folder, made, asked.runs)
        write_log(folder, flown)
        figures = figures_of(suite, entry, flown, len(made.skipped))
        if asked.json:
            print_json(figures)
        else:
            print_figures(figures, console)
