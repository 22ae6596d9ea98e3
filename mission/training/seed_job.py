"""How is one seed of a run put together?  Environment, learner, memory, exploration, evaluation from one spec."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from companion.core.types import F64
from companion.navigator.decide import policy_named
from companion.policy.actor import Actor
from companion.policy.decoder import encode_detour
from companion.policy.expert import GeometricExpert
from companion.policy.interface import Policy
from companion.policy.learned import LearnedPolicy
from companion.policy.store import Card, save_policy
from mission.errors import InputError
from mission.pilots.td3_vanilla import LowLevelCard, save_low_level
from mission.training.baselines import RANDOM, STRAIGHT, RandomPolicy, StraightPolicy
from mission.training.env import SwiftNavEnv
from mission.training.env_config import flight_spec, navigator_params
from mission.training.evaluate import fly_plan
from mission.training.exploration import Exploration
from mission.training.fleet import Member, OnUpdate, run_fleet
from mission.training.low_level import YAW_RATE_MAX_RAD_S, SwiftNavLowLevelEnv, ticks_of
from mission.training.metrics import Row
from mission.training.mirror import half_mirrored
from mission.training.parts import F32, Parts
from mission.training.replay import Batch, Replay
from mission.training.run_folder import RunSpec
from mission.training.scores import summary
from mission.training.status import Status
from mission.training.td3 import TD3
from mission.training.trainer import Trainer
from mission.training.training_worlds import KINDS, world_source

POLICY_FOLDER = "policy"  # below the seed's folder: what was learned, ready to fly
VALIDATION = "validation"
VALIDATION_SEEDS = 500_000_000  # the first; flights of evaluation below it, episodes draw anywhere
GREEDY = "greedy"
SHOWN = ("success", "contact", "timeout", "path_ratio", "time_s", "spl", "switches")  # of an evaluation


@dataclass(frozen=True, slots=True)
class SeedJob:
    """Trains one seed of the run; what a process, or a task on a cluster, is handed."""

    spec: RunSpec

    def __call__(self, seed: int, folder: Path) -> Iterator[Status]:
        """Train in ``folder`` from where it stands; leaves a policy there that can fly."""
        learner, parts = assemble(self.spec, seed)
        trainer = Trainer(parts, self.spec.preset.training, self.spec.until, seed, folder)
        for status in trainer.run():
            if status.state == "done":
                _save(folder / POLICY_FOLDER, learner.actor(), self.spec, seed, status)
            yield status


def train_fleet(spec: RunSpec, folder: Path, jobs: int, cluster: str | None, on_update: OnUpdate) -> list[Member]:
    """Every seed of the run, here or on a Ray cluster."""
    job = SeedJob(spec)
    if cluster is None:
        return run_fleet(job, spec.seeds, folder, jobs, on_update)
    from mission.training.ray_fleet import run_ray_fleet

    return run_ray_fleet(job, spec.seeds, folder, cluster, jobs, on_update)


def check(spec: RunSpec) -> None:
    """Raises InputError or ParamError about what cannot be trained, before any process starts."""
    environment(spec)
    try:
        torch.empty(1, device=spec.device)
    except (RuntimeError, AssertionError) as error:
        raise InputError(f"--device '{spec.device}': {str(error).splitlines()[0]}") from error
    training = spec.preset.training
    if spec.preset.env.low_level and (training.mirror or training.prefill_flights):
        raise InputError("training.mirror and training.prefill_flights are for paths: not with env.low_level")
    if training.prefill_flights and spec.preset.env.decoder != "detour":
        raise InputError(
            "training.prefill_flights needs the decoder 'detour': no other action says what the expert does"
        )


def environment(spec: RunSpec) -> SwiftNavEnv | SwiftNavLowLevelEnv:
    """What the policy learns in. Raises InputError or ParamError."""
    kind = SwiftNavLowLevelEnv if spec.preset.env.low_level else SwiftNavEnv
    return kind(spec.world, spec.preset.env)


def assemble(spec: RunSpec, seed: int) -> tuple[TD3, Parts]:
    """One seed, ready to train. Each part draws from a child of the seed, so none moves another's draws."""
    preset = spec.preset
    env = environment(spec)
    obs_dim, action_dim = env.observation_space.shape[0], env.action_space.shape[0]
    draws = [int(child.generate_state(1)[0]) for child in np.random.SeedSequence([seed, 0, 0]).spawn(3)]
    learner = TD3(obs_dim, action_dim, replace(preset.td3, device=spec.device), draws[0])
    memory = Replay(preset.replay.kind, preset.replay.capacity, obs_dim, action_dim, preset.replay, draws[1])
    explorer = Exploration(preset.exploration, action_dim, draws[2])
    parts = Parts(
        env,
        learner,
        memory,
        explorer,
        evaluate=None if preset.env.low_level else _Evaluation(spec, seed, learner),
        mirror=_mirror(spec) if preset.training.mirror else None,
        teacher=_Teacher(env) if preset.training.prefill_flights and isinstance(env, SwiftNavEnv) else None,
        physics_s=lambda: env.physics_s,
    )
    return learner, parts


@dataclass(slots=True)
class _Evaluation:
    """Greedy flights on draws of their own; the first seed's first one beside policies that learn nothing."""

    spec: RunSpec
    seed: int
    learner: TD3

    def __call__(self, episode: int) -> Row:
        config = self.spec.preset.env
        params = navigator_params(config)
        greedy = LearnedPolicy(GREEDY, self.learner.actor(), config.policy_spec(), params.map)
        row = {GREEDY: self._figures(greedy)}
        if episode == 0 and self.seed == self.spec.seeds[0]:
            row[STRAIGHT] = self._figures(StraightPolicy())
            row[RANDOM] = self._figures(RandomPolicy(self.seed, config.decoder))
        return row

    def _figures(self, policy: Policy) -> Row:
        config = self.spec.preset.env
        params = navigator_params(config)
        kind, *_ = self.spec.world.split(":")
        source = world_source(f"{kind}:{VALIDATION}" if kind in KINDS else self.spec.world, params.vehicle.radius_m)
        flights = []
        for number in range(self.spec.preset.training.evaluation_flights):
            flight_seed = VALIDATION_SEEDS + 1000 * self.seed + number
            world = source.draw(np.random.default_rng(flight_seed))
            flights.append(fly_plan(flight_spec(world, flight_seed, config, params).plan, policy))
        figures = summary(flights)
        return {name: figures[name] for name in SHOWN}


class _Teacher:
    """The geometric expert's path as an action."""

    def __init__(self, env: SwiftNavEnv) -> None:
        self._env = env
        self._expert = policy_named(GeometricExpert.name, navigator_params(env.config))
        self._memory: F64 | None = None

    def __call__(self, info: dict[str, Any]) -> F32:
        if "skipped" in info:  # of a reset
            self._memory = None
        query = self._env.query
        proposal, self._memory = self._expert.propose(query, self._memory)
        path_ne_m = query.goal_ne_m[None] if proposal is None else proposal.waypoints_ne_m
        return encode_detour(path_ne_m, query, self._env.config.decoder_params).astype(np.float32)


def _mirror(spec: RunSpec) -> Any:
    env = spec.preset.env

    def mirrored(batch: Batch) -> Batch:
        return half_mirrored(batch, env.observation, env.decoder)

    return mirrored


def _save(folder: Path, actor: Actor, spec: RunSpec, seed: int, status: Status) -> None:
    """A waypoint policy, or one that steers by itself: ``companion.policy.store``, ``mission.pilots.td3_vanilla``."""
    training = {
        "world": spec.world,
        "seed": seed,
        "preset": spec.preset.name,
        "episodes": status.progress.episodes,
        "successes": status.progress.successes,
        "decisions": status.progress.decisions,
        "updates": status.progress.updates,
    }
    env = spec.preset.env
    if env.low_level:
        hold_s = ticks_of(env) / env.scan_rate_hz
        card = LowLevelCard(env.observation, hold_s, YAW_RATE_MAX_RAD_S, training)
        save_low_level(folder, actor, card)
        return
    limits = ("trained for this world alone",) if spec.world.split(":")[0] not in KINDS else ()
    name = f"{Path(spec.world).stem.replace(':', '_')}_seed{seed}"
    save_policy(folder, actor, Card(name, env.policy_spec(), training, {}, limits))
