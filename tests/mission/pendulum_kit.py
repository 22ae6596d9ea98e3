"""A small real environment for the trainer: Gymnasium's pendulum, told as the flights tell theirs; and a tiny TD3."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.classic_control.pendulum import PendulumEnv

from mission.training.exploration import Exploration, ExplorationConfig
from mission.training.parts import F32, Parts
from mission.training.replay import Replay, ReplayConfig
from mission.training.status import Status
from mission.training.td3 import TD3, TD3Config
from mission.training.trainer import Trainer
from mission.training.until import TrainingConfig, Until

STEPS = 12
CONFIG = TrainingConfig(batch=16, warmup_decisions=20, checkpoint_every=3, evaluate_every=4, evaluation_flights=1)


class Pendulum(gymnasium.Wrapper[F32, F32, F32, F32]):
    """Twelve steps an episode; a success where it has swung less than it began with."""

    def __init__(self) -> None:
        super().__init__(PendulumEnv(g=9.81))
        self._steps, self._total = 0, 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[F32, dict[str, Any]]:
        self._steps, self._total = 0, 0.0
        obs, _ = self.env.reset(seed=seed, options=options)
        return obs, {"entered": True, "discount": 1.0}

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        obs, reward, *_ = self.env.step(2.0 * action)
        self._steps, self._total = self._steps + 1, self._total + float(reward)
        info: dict[str, Any] = {"entered": False, "discount": 0.98}
        if self._steps == STEPS:
            success = self._total > -60.0
            counts = {"steps": STEPS, "ticks": STEPS}
            info["episode"] = {"success": success, **counts, "return": self._total, "track_ne_m": [[0.0, 1.0]]}
        return obs, float(reward), False, self._steps == STEPS, info


def parts(seed: int, kind: str = "per", hidden: tuple[int, ...] = (16, 16)) -> Parts:
    """All sides of a seed."""
    learner = TD3(3, 1, TD3Config(hidden=hidden), seed)
    memory = Replay(kind, 200, 3, 1, ReplayConfig(), seed + 1)
    explorer = Exploration(ExplorationConfig(decay=0.9), 1, seed + 2)

    def evaluate(episode: int) -> dict[str, Any]:
        return {"greedy": {"success": 0.0, "action": float(learner.act(np.ones(3, np.float32))[0])}}

    return Parts(Pendulum(), learner, memory, explorer, evaluate)


@dataclass(frozen=True)
class PendulumJob:
    """Trains the pendulum; for a process of its own."""

    episodes: int
    kind: str = "per"

    def __call__(self, seed: int, folder: Path) -> Iterator[Status]:
        yield from Trainer(parts(seed, self.kind), CONFIG, Until(1000, self.episodes), seed, folder).run()
