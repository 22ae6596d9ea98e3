"""How does a seed of a run become a policy that ships?  Flown, judged, and put where ``fly`` finds it, with its card.

The card says what was trained, how every seed of the run did, and the greedy figures of whole missions with the guard
off and on, beside the policies that learned nothing. The same command writes the same card again.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from companion.policy.store import POLICIES, read_policy, save_policy
from mission.errors import FlightError, InputError
from mission.flight_log import read_rows
from mission.provenance import commit
from mission.training.baselines import RANDOM, STRAIGHT
from mission.training.evaluate import EvalSpec, fly_many
from mission.training.fleet import seed_folder
from mission.training.metrics import rows_file
from mission.training.run_folder import RunSpec, open_run
from mission.training.scores import FlightFigures, summary
from mission.training.seed_job import POLICY_FOLDER
from mission.training.training_worlds import KINDS

LAST = 50  # episodes of training whose success is told
BASELINE_FLIGHTS = 10
WALL = ("decision_p50_ms", "decision_p99_ms")  # of the machine, not of the policy
ENOUGH = 0.95  # success without the guard: less is said among the limits
SLOW = "took "  # what the judge says of a flight that landed at its goal too late
OnFlights = Callable[[str, int], None]  # what is flown next, how often


@dataclass(frozen=True, slots=True)
class Shipment:
    """Which policy, under which name, flown how often."""

    run: Path
    seed: int
    name: str
    flights: int = 100
    jobs: int = 1
    into: Path = POLICIES


def ship(shipment: Shipment, tell: OnFlights) -> dict[str, Any]:
    """Fly the seed's policy, write it and its card; the card's evaluation. Raises InputError or FlightError."""
    spec = open_run(shipment.run)
    if shipment.seed not in spec.seeds:
        raise InputError(f"'{shipment.run}' has no seed {shipment.seed}: it has {', '.join(map(str, spec.seeds))}")
    folder = seed_folder(shipment.run, shipment.seed) / POLICY_FOLDER
    if not folder.is_dir():
        raise InputError(f"{folder}: not there: 'swiftnav train --resume {shipment.run}' ends the training")
    card, actor = read_policy(folder)
    evaluation = _evaluation(shipment, spec, str(folder), tell)
    training = {**card.training, "commit": commit(), "seeds": seed_figures(shipment.run, spec)}
    try:
        target = shipment.into / shipment.name
        limits = (*card.limits, *limits_of(evaluation))
        shipped = replace(card, name=shipment.name, training=training, evaluation=evaluation, limits=limits)
        save_policy(target, actor, shipped)
    except OSError as error:
        raise FlightError(f"{shipment.into / shipment.name}: {error.strerror or error}") from error
    return evaluation


def seed_figures(run: Path, spec: RunSpec) -> dict[str, dict[str, float]]:
    """Of every seed that was trained: episodes, successes, share of the last fifty, contacts."""
    figures = {}
    for seed in spec.seeds:
        rows = list(read_rows(rows_file(seed_folder(run, seed), "episodes")))
        if rows:
            last = [bool(row["success"]) for row in rows[-LAST:]]
            contacts = sum(bool(row["contact"]) for row in rows)
            figures[str(seed)] = {
                "episodes": len(rows),
                "successes": sum(bool(row["success"]) for row in rows),
                "last_50": sum(last) / len(last),
                "contacts": contacts,
            }
    return figures


def judged_in(world: str) -> str:
    """Where a policy trained in ``world`` is judged: of a random kind the test split, which no training has seen."""
    kind, *_ = world.split(":")
    return kind if kind in KINDS else world


def figures_of(flights: Sequence[FlightFigures]) -> dict[str, Any]:
    """What a card says of some flights: rates, quality, why it was no success; ``arrived`` forgives being late."""
    figures = {name: value for name, value in summary(flights).items() if name not in (*WALL, "failures")}
    arrived = [flight for flight in flights if flight.success or flight.reason.startswith(SLOW)]
    ratios = [flight.path_ratio for flight in arrived if flight.path_ratio is not None]
    times = [flight.time_s for flight in arrived]
    reasons = Counter(flight.reason.split()[0] for flight in flights if not flight.success)
    return figures | {
        "arrived": len(arrived) / max(len(flights), 1),
        "arrived_path_ratio": sum(ratios) / len(ratios) if ratios else None,
        "arrived_time_s": sum(times) / len(times) if times else None,
        "reasons": dict(reasons),
    }


def limits_of(evaluation: dict[str, Any]) -> tuple[str, ...]:
    """Where the figures fall short of flying every mission, in words."""
    off = evaluation["guard_off"]
    told = []
    if off["success"] < ENOUGH:
        told.append(
            f"guard off, {off['success']:.0%} of {off['episodes']} flights are in time for the mission, "
            f"{off['arrived']:.1%} land at the goal: fly it with the guard on"
        )
    if off["contact"] > 0.0:
        told.append(f"guard off, {off['contact']:.1%} of the flights touch something")
    return tuple(told)


def _evaluation(shipment: Shipment, spec: RunSpec, policy: str, tell: OnFlights) -> dict[str, Any]:
    world = judged_in(spec.world)
    few = min(BASELINE_FLIGHTS, shipment.flights)
    sets = {
        "guard_off": (EvalSpec(policy, world), shipment.flights),
        "guard_on": (EvalSpec(policy, world, guard=True), shipment.flights),
        STRAIGHT: (EvalSpec(STRAIGHT, world), few),
        RANDOM: (EvalSpec(RANDOM, world), few),
    }
    evaluation = {}
    for name, (flown, count) in sets.items():
        tell(name, count)
        evaluation[name] = figures_of(list(fly_many(flown, range(count), shipment.jobs)))
    return evaluation
