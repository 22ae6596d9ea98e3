"""``swiftnav eval`` and ``swiftnav export``: how good is a policy, and how does it leave the house?"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.cli_options import Json, parse_switch, print_json, require_extra

if TYPE_CHECKING:
    from mission.training.scores import FlightFigures

RATES = ("success", "contact", "timeout")
SUMMED_UP = (
    ("spl", "success weighted by path length"),
    ("path_ratio", "flown to shortest, successes"),
    ("time_s", "take-over to touchdown, successes"),
    ("min_clearance_m", "least of all flights"),
    ("p05_clearance_m", "of the flights' least"),
    ("jerk_m2_s6", "mean square"),
    ("switches_per_min", "of nav modes"),
    ("switches_bound_per_min", "what the arbiter guarantees"),
    ("kept", "verdicts of the checker, share"),
    ("next", "its next choices"),
    ("modified", ""),
    ("escape", ""),
    ("refused", ""),
    ("guarded", "expert's path flown instead, share"),
    ("rl_share", "of the time in RL mode"),
    ("decision_p50_ms", "wall time of a tick with a decision"),
    ("decision_p99_ms", ""),
)

PolicyName = Annotated[str, typer.Argument(help="A shipped policy, a folder, or geometric, straight, random.")]
World = Annotated[str, typer.Option(help="A mission, a world file, or a random kind such as barrier or forest.")]
Episodes = Annotated[int, typer.Option("--episodes", min=1, max=100_000, help="Flights.")]
FirstSeed = Annotated[int, typer.Option("--seed", min=0, max=2**31, help="Of the first flight; then one up each.")]
Guard = Annotated[str, typer.Option(help="on: the geometric expert's proposal is one more candidate of the checker.")]
Jobs = Annotated[int, typer.Option(min=1, max=64, help="Processes.")]


def evaluate(
    policy: PolicyName,
    world: World = "trajectory2",
    episodes: Episodes = 20,
    seed: FirstSeed = 0,
    guard: Guard = "off",
    jobs: Jobs = 1,
    json: Json = False,
) -> None:
    """Fly a policy greedily over whole missions in process, judge every flight, sum up with 95 % Wilson intervals."""
    require_extra("sitl", "eval")
    guarded = parse_switch(guard, "--guard")
    from mission.training.baselines import policy_for
    from mission.training.evaluate import EvalSpec, fly_many
    from mission.training.flights import plan_in
    from mission.training.scores import summary

    spec = EvalSpec(policy, world, guarded)
    plan = plan_in(world, seed, spec.overrides())
    policy_for(policy, plan.params, seed)  # mistakes are told before anything flies
    flights = _shown(fly_many(spec, range(seed, seed + episodes), jobs), episodes, f"{policy} in {world}", json)
    settings = {"policy": policy, "world": world, "guard": guarded, "seed": seed}
    figures = {**settings, **summary(flights)}
    if json:
        print_json(figures)
    else:
        _print(figures)


def export(
    policy: Annotated[str, typer.Argument(help="A shipped policy or a folder.")],
    onnx: Annotated[Path, typer.Option(metavar="FILE", help="ONNX file to write.")],
    json: Json = False,
) -> None:
    """Write a policy's actor as ONNX, and compare what the file computes with what flies."""
    require_extra("train", "export")
    from companion.policy.store import folder_of
    from mission.training.export import export_onnx

    difference = export_onnx(folder_of(policy), onnx)
    if json:
        print_json({"policy": policy, "file": str(onnx), "largest_difference": difference})
        return
    typer.echo(f"{onnx}: at most {difference:.1e} away from what flies")


def _shown(flights: Any, count: int, title: str, quiet: bool) -> "list[FlightFigures]":
    """All of them, with a bar while they fly."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True, highlight=False, quiet=quiet)
    return list(track(flights, title, count, console=console))


def _print(figures: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    guard = "on" if figures["guard"] else "off"
    table = Table(
        title=f"{figures['policy']} in {figures['world']}, guard {guard}, {figures['episodes']} flights",
        title_justify="left",
    )
    for name, justify in (("figure", "left"), ("value", "right"), ("", "left")):
        table.add_column(name, justify="right" if justify == "right" else "left")
    for name in RATES:
        low, high = figures[f"{name}_ci95"]
        table.add_row(name, f"{figures[name]:.3f}", f"[{low:.3f}, {high:.3f}]")
    for name, text in SUMMED_UP:
        value = figures[name]
        table.add_row(name, "-" if value is None else f"{value:.3f}", text)
    console.print(table)
    for failure in figures["failures"]:
        console.print(f"  seed {failure['seed']} in {failure['world']}: {failure['reason']}", markup=False)
