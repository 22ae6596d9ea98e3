"""``swiftnav reproduce``: the paper's Results section and what it left for later, as one resumable run."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.cli_options import Json, print_json, require_extra
from mission.errors import FlightError, InputError

if TYPE_CHECKING:
    from mission.reproduce.arms import Arm
    from mission.reproduce.findings import Findings

OUT, QUICK_OUT, DOCS = Path("reproduce"), Path("reproduce_quick"), Path("docs")
SEEDS = 5

Only = Annotated[str | None, typer.Option(help="Arms or groups with commas between them; see --list.")]
Seeds = Annotated[int | None, typer.Option(min=1, max=1000, help="Of each arm: 1, 2, ...; default 5.")]
Jobs = Annotated[int | None, typer.Option(min=1, max=256, help="Seeds at once, of any arm; default: one a core.")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="What is done there is not done again.")]
Arms = Annotated[Path | None, typer.Option(metavar="FILE", help="Another table of arms, in YAML.")]
Quick = Annotated[bool, typer.Option("--quick", help="One seed, a few episodes of the main arms: does it all run?")]
List = Annotated[bool, typer.Option("--list", help="Say which arms there are, train nothing.")]
Report = Annotated[bool, typer.Option("--report", help="Write it all from what is there, train nothing.")]
Docs = Annotated[bool, typer.Option("--docs", help="Write ./docs/reproduction.md and its pictures as well.")]


def reproduce(
    only: Only = None,
    seeds: Seeds = None,
    jobs: Jobs = None,
    out: Out = None,
    arms: Arms = None,
    quick: Quick = False,
    listing: List = False,
    report: Report = False,
    docs: Docs = False,
    json: Json = False,
) -> None:
    """Train every arm, draw the paper's figures, judge its claims. Killed at any moment, the same command goes on."""
    require_extra("train", "reproduce")
    from mission.reproduce.arms import load_table
    from mission.reproduce.document import write_docs, write_readme
    from mission.reproduce.findings import findings
    from mission.reproduce.pictures import draw_all

    table = load_table(arms, quick)
    chosen = table.chosen(only)
    if listing:
        _list(chosen, json)
        return
    folder = out or (QUICK_OUT if quick else OUT)
    count = seeds or (1 if quick else SEEDS)
    if docs and not DOCS.is_dir():
        raise InputError("--docs writes into ./docs, and there is none here")
    troubles = [] if report else _train(folder, table, chosen, count, jobs, json)
    found = findings(folder, table)
    if not found.arms:
        raise InputError(f"'{folder}' holds no reproduction")
    pictures = draw_all(found, folder)
    again = _again(only, arms, count, quick)
    documents = [write_readme(found, pictures, folder, again)]
    if docs:
        documents.append(write_docs(found, pictures, DOCS, again))
    if json:
        print_json({"out": str(folder), "documents": [str(path) for path in documents], **found.as_dict()})
    else:
        _print(found, documents)
    if troubles:
        raise FlightError(f"{'; '.join(troubles)}; the same command goes on")


def _train(folder: Path, table: Any, chosen: "Sequence[Arm]", count: int, jobs: int | None, quiet: bool) -> list[str]:
    """What failed, a line each."""
    from mission.reproduce.run import check, prepare, run_all
    from mission.reproduce.view import ArmsView
    from mission.training.fleet import cores

    numbers = range(1, count + 1)
    check(chosen)
    prepare(folder, chosen, numbers)
    with ArmsView(quiet) as view:
        return run_all(folder, table, chosen, numbers, jobs or cores(), view.update)


def _list(chosen: "Sequence[Arm]", json: bool) -> None:
    if json:
        names = ("name", "run", "group", "text", "world", "settings", "ticks_of", "seeds")
        rows = [
            {**{name: getattr(arm, name) for name in names}, "preset": arm.preset.name, "episodes": arm.until.episodes}
            for arm in chosen
        ]
        print_json({"arms": rows})
        return
    from rich.console import Console
    from rich.table import Table

    shown = Table()
    for name in ("group", "arm", "world", "preset", "seeds", "episodes", "what"):
        shown.add_column(name, no_wrap=name in ("arm", "world"))
    for arm in chosen:
        seeds, episodes = (
            str(arm.seeds or "all"),
            f"ticks of {arm.ticks_of}" if arm.ticks_of else str(arm.until.episodes),
        )
        shown.add_row(arm.group, arm.name, arm.world, arm.preset.name, seeds, episodes, arm.text)
    Console(highlight=False, emoji=False).print(shown)


def _print(found: "Findings", documents: Sequence[Path]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, emoji=False)
    shown = Table()
    for name in ("paper claim", "settings", "measured here", "seeds", "holds?"):
        shown.add_column(name)
    for outcome in found.outcomes:
        shown.add_row(outcome.claim.text, outcome.settings, outcome.measured, outcome.seeds, str(outcome.verdict))
    console.print(shown)
    console.print(", ".join(f"{count} {name}" for name, count in found.counts().items()), markup=False)
    for path in documents:
        console.print(f"written: {path}", markup=False)


def _again(only: str | None, arms: Path | None, seeds: int, quick: bool) -> str:
    """The command that trains the same once more."""
    table = ["--arms", str(arms)] if arms else []
    words = ["swiftnav", "reproduce", *table, *(["--only", only] if only else []), "--seeds", str(seeds)]
    return shlex.join([*words, *(["--quick"] if quick else [])])
