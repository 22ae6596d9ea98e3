"""What exactly will be flown?  Mission, world, parameters and the draws of the seed, checked before anything starts.

Every draw comes from ``numpy.random.SeedSequence(seed)``, one child per purpose, so a new draw moves no other one.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.core import params as core_params
from companion.core.params import ParamError
from companion.core.task import Task
from companion.core.types import F64
from companion.navigator.decide import policy_named
from companion.navigator.params import Params
from companion.policy.expert import GeometricExpert
from companion.policy.store import digest_of
from mission.errors import InputError
from mission.mission_file import ForestSpec, Mission, load_mission
from mission.strict_yaml import checked
from mission.world_check import check_world, clearance_m
from mission.world_file import load_world
from mission.world_generator import generate_forest
from sitl.world import World

SPAWN_CLEARANCE_M = 0.5  # beyond the radius: take-off in wind drifts
SPAWN_TRIES = 1000
DECIMALS = 6  # of the goal [m]: exact as text on the companion's command line


@dataclass(frozen=True, slots=True)
class Draws:
    """What the seed decides."""

    spawn_ned_m: tuple[float, float]  # world
    yaw_rad: float
    wind_ned_m_s: tuple[float, float, float]
    sim_seed: int  # gusts, LiDAR noise
    mover_seed: int


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """One flight, complete; the vehicle's local ned has its origin at ``draws.spawn_ned_m`` on the ground."""

    mission: Mission
    world: World  # movers seeded
    params: Params
    seed: int
    draws: Draws
    task: Task  # local ned

    def policy_sha256(self) -> str | None:
        """Of the weights of the policy that flies; None for the expert, which has none."""
        name = self.params.policy.name
        return None if name == GeometricExpert.name else digest_of(name)


def plan_flight(
    name_or_path: str,
    seed: int,
    overrides: dict[str, dict[str, Any]] | None = None,
    world: str | None = None,
    policy: str | None = None,
    faults: Sequence[str] = (),
) -> FlightPlan:
    """Check everything and draw. Raises InputError or ParamError with one line."""
    mission = load_mission(name_or_path)
    if world is not None:
        mission = checked(Mission, {**mission.model_dump(), "world": world, "forest": None}, "--world")
    if policy is not None:
        mission = checked(Mission, {**mission.model_dump(), "policy": policy}, "--policy")
    if faults:
        more = {"faults": (*mission.faults, *faults)}
        mission = checked(Mission, {**mission.model_dump(), **more}, "--fault")
    plan = plan_mission(mission, seed, overrides)
    policy_named(plan.params.policy.name, plan.params)  # what does not fit is told before anything flies
    return plan


def plan_mission(mission: Mission, seed: int, overrides: dict[str, dict[str, Any]] | None = None) -> FlightPlan:
    """``plan_flight`` for a mission that is already loaded."""
    params = mission_params(mission, overrides)
    surroundings = mission_world(mission, seed, params.vehicle.radius_m)
    draws = draw(mission, surroundings, seed, params.vehicle.radius_m)
    offset_ned_m = (surroundings.goal_ned_m - np.array(draws.spawn_ned_m)).tolist()
    goal_ned_m: F64 = np.array([round(metres, DECIMALS) for metres in offset_ned_m])
    task = Task(goal_ned_m, mission.down_m, mission.cruise_m_s)
    return FlightPlan(mission, surroundings.seeded(draws.mover_seed), params, seed, draws, task)


def mission_world(mission: Mission, seed: int, radius_m: float) -> World:
    """The mission's world with its start and goal, checked for a way; movers not yet seeded. Raises InputError."""
    if mission.world is not None:
        return load_world(mission.world, mission.start, mission.goal, radius_m)
    forest = mission.forest or ForestSpec()
    world_seed = seed if forest.seed is None else forest.seed
    world = generate_forest(
        world_seed, forest.density_per_m2, forest.size_m, forest.trunk_diameter_m, radius_m=radius_m
    )
    start_ned_m = world.start_ned_m if mission.start is None else np.array(mission.start)
    goal_ned_m = world.goal_ned_m if mission.goal is None else np.array(mission.goal)
    world = dataclasses.replace(world, start_ned_m=start_ned_m, goal_ned_m=goal_ned_m)
    check_world(world, radius_m)
    return world


def mission_params(mission: Mission, overrides: dict[str, dict[str, Any]] | None = None) -> Params:
    """The companion's parameters: defaults, then the mission's, then ``overrides``. Raises ParamError."""
    try:
        params = core_params.update(Params(), {"policy": {"name": mission.policy}})
        params = core_params.update(params, mission.params)
    except ParamError as error:
        raise ParamError(f"mission {mission.name}: {error}") from error
    return core_params.update(params, overrides or {})


def draw(mission: Mission, world: World, seed: int, radius_m: float) -> Draws:
    """Start, nose, wind and seeds for one flight. Raises InputError when no free place is near the start."""
    spawn, wind, sim, movers = np.random.SeedSequence(seed).spawn(4)
    spawn_ned_m, yaw_rad = _draw_spawn(np.random.default_rng(spawn), mission, world, radius_m)
    rng = np.random.default_rng(wind)
    speed_m_s = rng.uniform(*mission.wind.mean_m_s)
    towards_rad = rng.uniform(-math.pi, math.pi)
    wind_ned_m_s = (speed_m_s * math.cos(towards_rad), speed_m_s * math.sin(towards_rad), 0.0)
    return Draws(spawn_ned_m, yaw_rad, wind_ned_m_s, _as_int(sim), _as_int(movers))


def _draw_spawn(
    rng: np.random.Generator, mission: Mission, world: World, radius_m: float
) -> tuple[tuple[float, float], float]:
    """A free place, uniform over the disc round the start, and the nose, uniform over the circle."""
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    for _ in range(SPAWN_TRIES):
        away_m = mission.spawn_jitter_m * math.sqrt(rng.uniform())
        bearing_rad = rng.uniform(-math.pi, math.pi)
        place = world.start_ned_m + away_m * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
        free = world.inside(*place) and float(clearance_m(world, place[None, :])[0]) >= radius_m + SPAWN_CLEARANCE_M
        if free and not _near_mover(world, place, radius_m):
            return (float(place[0]), float(place[1])), yaw_rad
    raise InputError(
        f"mission {mission.name}: no place with {radius_m + SPAWN_CLEARANCE_M:.2f} m to every obstacle"
        f" within {mission.spawn_jitter_m:g} m of the start"
    )


def _near_mover(world: World, place: F64, radius_m: float) -> bool:
    gaps = (math.dist(m.position_ned_m(0.0), place) - m.radius_m for m in world.movers)
    return any(gap < radius_m + SPAWN_CLEARANCE_M for gap in gaps)


def _as_int(sequence: np.random.SeedSequence) -> int:
    return int(sequence.generate_state(1)[0])
