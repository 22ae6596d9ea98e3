"""How does a clone become a policy that ships? Flown in every kind of world, guard off and on, beside its teacher.

Every flight is kept in the run's folder as soon as it is over: a shipment that was cut off goes on where it was. The
same command writes the same figures again, wall times aside.
"""

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from companion.policy.expert import GeometricExpert
from companion.policy.store import POLICIES, read_policy, save_policy
from mission.bench.run import commit
from mission.errors import FlightError, InputError
from mission.flight_log import read_rows
from mission.training.dagger_config import read_config
from mission.training.evaluate import EvalSpec, fly_one
from mission.training.scores import FlightFigures
from mission.training.ship import figures_of

FLOWN = "shipping.jsonl"
WORLDS = (
    "forest04", "forest08", "forest12", "forest15", "barrier", "deep", "two", "t2like", "pocket",
)  # fmt: skip
LIMITS = (
    "Trained and tested at 3 m/s cruise, 72 sectors of 5 deg, standing obstacles, winds up to 6 m/s; nothing else.",
    "Alone (guard off) it may circle in front of what it cannot pass until the time is over; the guard ends that.",
    "Its paths are straight legs of 4 m and pass obstacles nearer than the expert's: alone it flies slower than that.",
)


@dataclass(frozen=True, slots=True)
class CloneShipment:
    """Which clone, under which name, flown where and how often."""

    run: Path
    name: str
    worlds: tuple[str, ...] = WORLDS
    flights: int = 20  # in each world, guard off, on, and the expert
    seed: int = 100  # number of the first test world
    into: Path = POLICIES


def ship_clone(shipment: CloneShipment, tell: Callable[[int, int], None]) -> dict[str, Any]:
    """Fly the run's last policy, write it and its card; the card's evaluation by world.

    ``tell`` hears how many flights are over, of how many. Raises InputError or FlightError.
    """
    config = read_config(shipment.run)
    folder = shipment.run / f"round-{config.rounds - 1}"
    if not folder.is_dir():
        raise InputError(f"{folder}: not there: 'swiftnav clone --resume {shipment.run}' ends the training")
    card, actor = read_policy(folder)
    evaluation = _evaluation(shipment, str(folder), tell)
    training = {**card.training, "commit": commit()}
    try:
        target = shipment.into / shipment.name
        save_policy(
            target, actor, replace(card, name=shipment.name, training=training, evaluation=evaluation, limits=LIMITS)
        )
    except OSError as error:
        raise FlightError(f"{shipment.into / shipment.name}: {error.strerror or error}") from error
    return evaluation


def arms(policy: str, world: str) -> dict[str, EvalSpec]:
    """What is flown in a world, by name."""
    return {
        "guard_off": EvalSpec(policy, world),
        "guard_on": EvalSpec(policy, world, guard=True),
        GeometricExpert.name: EvalSpec(GeometricExpert.name, world),
    }


def _evaluation(shipment: CloneShipment, policy: str, tell: Callable[[int, int], None]) -> dict[str, Any]:
    log = shipment.run / FLOWN
    known = {_key(row): _figures(row["figures"]) for row in read_rows(log)}
    seeds = range(shipment.seed, shipment.seed + shipment.flights)
    planned = [(world, arm, seed) for seed in seeds for world in shipment.worlds for arm in arms(policy, world)]
    with log.open("a", encoding="utf-8") as file:
        for count, key in enumerate(planned):
            tell(count, len(planned))
            if key in known:
                continue
            world, arm, seed = key
            known[key] = fly_one(arms(policy, world)[arm], seed)
            row = {"world": world, "arm": arm, "figures": dataclasses.asdict(known[key])}
            file.write(json.dumps(row) + "\n")
            file.flush()
    return {
        world: {arm: figures_of(_flights(known, world, arm, seeds)) for arm in arms(policy, world)}
        for world in shipment.worlds
    }


def _flights(
    known: dict[tuple[str, str, int], FlightFigures], world: str, arm: str, seeds: Sequence[int]
) -> list[FlightFigures]:
    return [known[(world, arm, seed)] for seed in seeds]


def _key(row: dict[str, Any]) -> tuple[str, str, int]:
    return row["world"], row["arm"], row["figures"]["seed"]


def _figures(values: dict[str, Any]) -> FlightFigures:
    return FlightFigures(**{**values, "tick_ms": tuple(values["tick_ms"])})
