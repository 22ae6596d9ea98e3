"""How does what was learned in random worlds ship? Flown in every kind of them, guard off and on, beside the expert.

Every flight is kept in the run's folder as soon as it is over: a shipment that was cut off goes on where it was. The
same command writes the same figures again, wall times aside.
"""

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from companion.policy.expert import GeometricExpert
from companion.policy.store import POLICIES, read_policy, save_policy
from mission.errors import FlightError, InputError
from mission.flight_log import read_rows
from mission.provenance import commit
from mission.training.dagger_config import FILE, read_config
from mission.training.evaluate import EvalSpec, fly_one
from mission.training.scores import FlightFigures
from mission.training.seed_job import POLICY_FOLDER
from mission.training.ship import figures_of

FLOWN = "shipping.jsonl"
WORLDS = (
    "forest04", "forest08", "forest12", "forest15", "barrier", "deep", "two", "t2like", "pocket",
)  # fmt: skip
LIMITS = (
    "Alone (guard off) it may circle in front of what it cannot pass until the time is over; the guard ends that.",
    "Alone it flies slower than the expert.",
)
OPEN = "Trained and tested at 3 m/s cruise, 72 sectors of 5 deg, standing obstacles, winds up to 6 m/s; nothing else."
PROFILED = (
    "Trained and tested with the profile '{}' at {:g} m/s cruise, 72 sectors of 5 deg, standing obstacles, winds up to"
    " {:g} m/s; nothing else."
)
GUARD_OFF = "guard_off"


@dataclass(frozen=True, slots=True)
class CloneShipment:
    """Which policy, under which name, flown where and how often."""

    run: Path  # of ``swiftnav clone``, or a seed's folder of ``swiftnav train``
    name: str
    worlds: tuple[str, ...] = WORLDS
    flights: int = 20  # in each kind, guard off
    beside: int = 20  # guard on, and the expert
    seed: int = 100  # number of the first test world
    into: Path = POLICIES


def ship_clone(shipment: CloneShipment, tell: Callable[[int, int], None]) -> dict[str, Any]:
    """Fly the run's last policy, write it and its card; the card's evaluation by world.

    ``tell`` hears how many flights are over, of how many. Raises InputError or FlightError.
    """
    folder = _learned(shipment.run)
    card, actor = read_policy(folder)
    evaluation = _evaluation(shipment, str(folder), tell)
    training = {**card.training, "commit": commit()}
    try:
        target = shipment.into / shipment.name
        save_policy(
            target,
            actor,
            replace(card, name=shipment.name, training=training, evaluation=evaluation, limits=_limits(training)),
        )
    except OSError as error:
        raise FlightError(f"{shipment.into / shipment.name}: {error.strerror or error}") from error
    return evaluation


def arms(policy: str, world: str) -> dict[str, EvalSpec]:
    """What is flown in a world, by name."""
    return {
        GUARD_OFF: EvalSpec(policy, world),
        "guard_on": EvalSpec(policy, world, guard=True),
        GeometricExpert.name: EvalSpec(GeometricExpert.name, world),
    }


def _limits(training: Mapping[str, Any]) -> tuple[str, ...]:
    """What it is not good for, by the settings of its training."""
    profile = training.get("profile")
    return (
        OPEN if profile is None else PROFILED.format(profile, training["cruise_m_s"], training["wind_m_s"][1]),
        *LIMITS,
    )


def _learned(run: Path) -> Path:
    """The folder of the policy."""
    if (run / POLICY_FOLDER).is_dir() and not (run / FILE).is_file():
        return run / POLICY_FOLDER
    folder = run / f"round-{read_config(run).rounds - 1}"
    if not folder.is_dir():
        raise InputError(f"{folder}: not there: 'swiftnav clone --resume {run}' ends the training")
    return folder


def _evaluation(shipment: CloneShipment, policy: str, tell: Callable[[int, int], None]) -> dict[str, Any]:
    log = shipment.run / FLOWN
    known = {_key(row): _figures(row["figures"]) for row in read_rows(log)}
    seeds = {
        arm: range(shipment.seed, shipment.seed + (shipment.flights if arm == GUARD_OFF else shipment.beside))
        for arm in arms(policy, "")
    }
    planned = [(world, arm, seed) for arm in seeds for seed in seeds[arm] for world in shipment.worlds]
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
        world: {arm: figures_of(_flights(known, world, arm, seeds[arm])) for arm in seeds} for world in shipment.worlds
    }


def _flights(
    known: dict[tuple[str, str, int], FlightFigures], world: str, arm: str, seeds: Sequence[int]
) -> list[FlightFigures]:
    return [known[(world, arm, seed)] for seed in seeds]


def _key(row: dict[str, Any]) -> tuple[str, str, int]:
    return row["world"], row["arm"], row["figures"]["seed"]


def _figures(values: dict[str, Any]) -> FlightFigures:
    return FlightFigures(**{**values, "tick_ms": tuple(values["tick_ms"])})
