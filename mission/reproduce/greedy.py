"""How does a trained seed fly once nothing is explored?  Greedy flights in the arm's own environment, kept beside it.

The same draws for the same seed number in every arm, and none that training saw. Random kinds are flown in worlds of
their validation split.
"""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from companion.core.frames import wrap_rad
from companion.core.types import F64
from companion.policy.learned import LearnedPolicy
from mission.errors import FlightError
from mission.provenance import commit, machine
from mission.training.checkpoint import load_newest, write_whole
from mission.training.env import SwiftNavEnv
from mission.training.env_config import navigator_params
from mission.training.evaluate import fly_plan
from mission.training.low_level import SwiftNavLowLevelEnv
from mission.training.parts import F32
from mission.training.path_ratio import path_ratio
from mission.training.run_folder import RunSpec
from mission.training.scores import summary
from mission.training.seed_job import GREEDY as NAME
from mission.training.seed_job import VALIDATION, assemble, environment
from mission.training.td3 import TD3
from mission.training.training_worlds import KINDS

GREEDY = "greedy.json"
FIRST_SEED = 600_000_000
LEAST_STEP_M = 0.05  # a shorter piece of a track has no direction

Env = SwiftNavEnv | SwiftNavLowLevelEnv
Row = dict[str, Any]


def fly_greedily(spec: RunSpec, seed: int, folder: Path, flights: int) -> None:
    """Fly what the seed has learned; ``greedy.json`` in its folder. Raises FlightError without a checkpoint."""
    loaded = load_newest(folder)
    if loaded is None:
        raise FlightError(f"{folder}: nothing was learned here yet")
    learner, _ = assemble(spec, seed)
    learner.load_state_dict(loaded.state["learner"])
    kind, *_ = spec.world.split(":")
    env = environment(replace(spec, world=f"{kind}:{VALIDATION}") if kind in KINDS else spec)
    rows = [fly_one(env, learner.act, FIRST_SEED + 1000 * seed + number) for number in range(flights)]
    stamp = {"date": datetime.now(UTC).strftime("%Y-%m-%d"), "commit": commit(), "machine": machine()}
    flown = {**stamp, "decision_p99_ms": _decision_p99_ms(env, learner), "flights": rows}
    write_whole(folder / GREEDY, json.dumps(flown).encode())


def fly_one(env: Env, act: Callable[[F32], F32], seed: int) -> Row:
    """One flight: the environment's figures of the episode, and what its track says."""
    obs, _ = env.reset(seed=seed)
    info: dict[str, Any] = {}
    while "episode" not in info:
        obs, _, _, _, info = env.step(act(obs))
    row = dict(info["episode"])
    if row["path_ratio"] is None:
        row["path_ratio"] = path_ratio(env.flight, known=True)
    track, goal = np.array(row["track_ne_m"]), env.flight.spec.plan.world.goal_ned_m
    row["gained_m"] = gained_m(track, goal)
    row["turning_deg_per_m"] = turning_deg_per_m(track)
    clean: Row = json.loads(json.dumps(row), parse_constant=lambda _: None)
    return clean


def gained_m(track_ne_m: F64, goal_ne_m: F64) -> float:
    """How much nearer to the goal a track ends than it began; (n, 2)."""
    first_m, last_m = np.hypot(*(track_ne_m[[0, -1]] - goal_ne_m).T).tolist()
    return float(first_m - last_m)


def turning_deg_per_m(track_ne_m: F64) -> float | None:
    """Sum of all changes of direction over the length of a track (n, 2): 0 is straight. None where nothing moved."""
    steps = np.diff(track_ne_m, axis=0)
    steps = steps[np.hypot(*steps.T) >= LEAST_STEP_M]
    if len(steps) < 2:
        return None
    courses = np.arctan2(steps[:, 1], steps[:, 0])
    turned = sum(abs(wrap_rad(float(change))) for change in np.diff(courses))
    return math.degrees(turned) / float(np.sum(np.hypot(*steps.T)))


def _decision_p99_ms(env: Env, learner: TD3) -> float | None:
    """Wall time of a tick with a decision, over the flight just flown once more as a mission; None for the baseline."""
    if isinstance(env, SwiftNavLowLevelEnv):
        return None
    policy = LearnedPolicy(NAME, learner.actor(), env.config.policy_spec(), navigator_params(env.config).map)
    p99_ms: float | None = summary([fly_plan(env.flight.spec.plan, policy)])["decision_p99_ms"]
    return p99_ms
