"""Which flight is meant by a world and a seed?  Tracks, world files and random kinds, all as one flight plan.

A track is flown under its mission's own conditions, a world file under those of ``trajectory2``, a random kind under
those of ``forest`` in the world of its split whose number is the seed: ``barrier`` means ``barrier:test``. Tight kinds
are flown slower, in still air, with the profile ``tight``.
"""

from typing import Any

import numpy as np

from companion.core.params import nearest
from companion.core.task import Task
from companion.navigator.profiles import profile_named
from mission.errors import InputError
from mission.flight_plan import DECIMALS, FlightPlan, draw, mission_params, plan_mission
from mission.mission_file import Mission, list_missions, load_mission
from mission.strict_yaml import checked
from mission.training.training_worlds import KINDS, SPLITS, TIGHT_KINDS, random_world
from mission.world_file import list_worlds
from sitl.world import World

FILE_MISSION, KIND_MISSION = "trajectory2", "forest"
TEST = SPLITS[-1]
TIGHT = "tight"  # the profile

Overrides = dict[str, dict[str, Any]]


def plan_in(world: str, seed: int, overrides: Overrides | None = None) -> FlightPlan:
    """One flight. Raises InputError or ParamError."""
    kind, _, split = world.partition(":")
    if kind in KINDS:
        mission = _conditions(kind)
        radius_m = mission_params(mission, overrides).vehicle.radius_m
        return plan_world(mission, random_world(kind, split or TEST, seed, radius_m), seed, overrides)
    if world in list_missions():
        return plan_mission(load_mission(world), seed, overrides)
    if world not in list_worlds() and not world.endswith((".yaml", ".yml")):
        known = [*KINDS, *list_missions(), *list_worlds()]
        raise InputError(f"unknown world '{world}'{nearest(world, known)}")
    conditions = {**load_mission(FILE_MISSION).model_dump(), "world": world}
    return plan_mission(checked(Mission, conditions, "--world"), seed, overrides)


def _conditions(kind: str) -> Mission:
    """The mission under whose conditions a random kind is flown."""
    mission = load_mission(KIND_MISSION)
    if kind not in TIGHT_KINDS:
        return mission
    tight = {"cruise_m_s": 2.0, "spawn_jitter_m": 0.05, "wind": {"mean_m_s": [0.0, 0.0], "turbulence": "none"}}
    return checked(Mission, {**mission.model_dump(), **tight, "params": profile_named(TIGHT)}, f"kind {kind}")


def plan_world(mission: Mission, world: World, seed: int, overrides: Overrides | None = None) -> FlightPlan:
    """A flight under the mission's conditions in a world that no file holds."""
    params = mission_params(mission, overrides)
    draws = draw(mission, world, seed, params.vehicle.radius_m)
    offset_ned_m = (world.goal_ned_m - np.array(draws.spawn_ned_m)).tolist()
    task = Task(np.array([round(metres, DECIMALS) for metres in offset_ned_m]), mission.down_m, mission.cruise_m_s)
    return FlightPlan(mission, world.seeded(draws.mover_seed), params, seed, draws, task)
