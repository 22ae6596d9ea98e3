"""Is our TD3 the TD3 that others know? The same training with stable-baselines3's, seed by seed; a few minutes a core.

``python -m mission.training.compare_sb3``: a lane with five trunks, five seeds; exit code 0 where the intervals of
success over seeds overlap, in training and greedily after it. Needs the extra ``compare``.

Both sides get the same flights, hyper-parameters, exploration (evenly drawn until learning starts, then Gaussian noise)
and updates a decision. What SB3 does not have is off in ours: prioritized replay, the saturation penalty, a discount by
the time that a decision took. So both discount by the decision, with one constant.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3 import TD3 as SB3
from stable_baselines3.common.callbacks import StopTrainingOnMaxEpisodes
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv

from mission.reproduce.measures import Interval, over_seeds
from mission.training.env_config import EnvConfig
from mission.training.parts import F32, Parts
from mission.training.replay import Replay, ReplayConfig
from mission.training.td3 import TD3, TD3Config
from mission.training.trainer import Trainer, episode_seed
from mission.training.until import TrainingConfig, Until
from sitl.world import World

TRUNKS = ((6.0, 1.2), (6.5, -1.4), (9.0, 0.1), (12.5, -1.5), (12.0, 1.6))
# Short, so that without penalty and prioritized replay something is learned in a minute: on Trajectory 1, 40 flights
# end with 3 to 5 % of successes on both sides, which says nothing.
LANE = World(
    name="lane",
    start_ned_m=np.zeros(2),
    goal_ned_m=np.array([18.0, 0.0]),
    bounds_m=(-6.0, -9.0, 24.0, 9.0),
    circles=np.array([(n, e, 0.4, np.inf) for n, e in TRUNKS]),
    boxes=np.empty((0, 6)),
)
ENV = EnvConfig(time_limit_s=30.0, scan_rate_hz=12.5)
GAMMA = 0.98  # a decision
NOISE_SIGMA = 0.1
LEARNING = TD3Config(
    hidden=(64, 64), actor_rate=5e-4, critic_rate=5e-4, saturation_penalty=0.0, reward_scale=1.0, zero_last=False
)
TRAINING = TrainingConfig(batch=128, updates_per_decision=2, warmup_decisions=128, evaluate_every=0)
CAPACITY = 50_000
STEPS_MAX = 10**9  # SB3 wants a number; episodes end it
GREEDY_FIRST = 10**8  # number of the first greedy flight
SIDES = ("ours", "sb3")


@dataclass(frozen=True, slots=True)
class Trained:
    """One seed of one side: shares of successes, and how much was learned from what."""

    success: float
    greedy: float
    decisions: int
    updates: int
    wall_s: float


class Flights(gymnasium.Wrapper[F32, F32, F32, F32]):
    """The registered environment with its flights numbered from 0, one constant discount, results kept aside."""

    def __init__(self, seed: int) -> None:
        super().__init__(gymnasium.make("mission.training:SwiftNav-v0", world=LANE, config=ENV).unwrapped)
        self.flown: list[dict[str, Any]] = []
        self.number = 0
        self._seed = seed

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[F32, dict[str, Any]]:
        """The next flight, whoever asks with whatever seed."""
        obs, info = self.env.reset(seed=episode_seed(self._seed, self.number), options=options)
        self.number += 1
        return obs, info

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """As it is, but for the discount."""
        obs, reward, terminated, truncated, info = self.env.step(action)
        if "episode" in info:
            self.flown.append(info["episode"])
        return obs, float(reward), terminated, truncated, {**info, "discount": GAMMA}


class Plain(gymnasium.Wrapper[F32, F32, F32, F32]):
    """Without ``info["episode"]``, a name that SB3 has another use for."""

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """The rest."""
        obs, reward, terminated, truncated, info = self.env.step(action)
        return obs, float(reward), terminated, truncated, {k: v for k, v in info.items() if k != "episode"}


class GaussianNoise:
    """SB3's exploration, as our trainer asks for it."""

    epsilon = 0.0

    def __init__(self, action_dim: int, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._dim, self._decisions = action_dim, 0

    def start_episode(self, episode: int) -> None:
        """Nothing changes with episodes."""

    def explore(self, greedy: F32, info: dict[str, Any]) -> F32:
        """Evenly drawn until learning starts, then noise on top."""
        self._decisions += 1
        if self._decisions <= TRAINING.warmup_decisions:
            return self._rng.uniform(-1.0, 1.0, self._dim).astype(np.float32)
        noisy: F32 = np.clip(greedy + NOISE_SIGMA * self._rng.normal(size=self._dim), -1.0, 1.0).astype(np.float32)
        return noisy

    def state_dict(self) -> dict[str, Any]:
        """All that decides the next draw."""
        return {"generator": json.dumps(self._rng.bit_generator.state), "decisions": self._decisions}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """As it was."""
        self._rng.bit_generator.state = json.loads(state["generator"])
        self._decisions = int(state["decisions"])


def train_ours(seed: int, episodes: int, greedy: int) -> Trained:
    """Our trainer, TD3 and replay."""
    env, begun_s = Flights(seed), time.perf_counter()
    obs_dim, action_dim = _sizes(env)
    learner = TD3(obs_dim, action_dim, LEARNING, seed)
    memory = Replay("uniform", CAPACITY, obs_dim, action_dim, ReplayConfig(), seed)
    parts = Parts(env, learner, memory, GaussianNoise(action_dim, seed))
    with tempfile.TemporaryDirectory() as folder:
        until = Until(successes=episodes + 1, episodes=episodes)
        trainer = Trainer(parts, TRAINING, until, seed, Path(folder))
        for _ in trainer.run():
            pass
    spent_s = time.perf_counter() - begun_s
    progress = trainer.progress
    return _trained(env, learner.act, (progress.decisions, progress.updates), episodes, greedy, spent_s)


def train_sb3(seed: int, episodes: int, greedy: int) -> Trained:
    """SB3's TD3 and replay."""
    env, begun_s = Flights(seed), time.perf_counter()
    _, action_dim = _sizes(env)
    model = SB3(
        "MlpPolicy",
        DummyVecEnv([lambda: Plain(env)]),
        learning_rate=LEARNING.critic_rate,
        buffer_size=CAPACITY,
        learning_starts=TRAINING.warmup_decisions,
        batch_size=TRAINING.batch,
        tau=LEARNING.tau,
        gamma=GAMMA,
        train_freq=1,
        gradient_steps=TRAINING.updates_per_decision,
        action_noise=NormalActionNoise(np.zeros(action_dim), np.full(action_dim, NOISE_SIGMA)),
        policy_delay=LEARNING.actor_every,
        target_policy_noise=LEARNING.smoothing_sigma,
        target_noise_clip=LEARNING.smoothing_clip,
        policy_kwargs={"net_arch": list(LEARNING.hidden)},
        seed=seed,
        device="cpu",
    )
    model.learn(STEPS_MAX, callback=StopTrainingOnMaxEpisodes(episodes))
    spent_s = time.perf_counter() - begun_s

    def act(obs: F32) -> F32:
        action, _ = model.predict(obs, deterministic=True)
        return np.asarray(action, np.float32)

    return _trained(env, act, (model.num_timesteps, model._n_updates), episodes, greedy, spent_s)


def compare(seeds: int, episodes: int, greedy: int, told: Callable[[str], None]) -> dict[str, dict[str, Interval]]:
    """Intervals of success by side: ``success`` in training, ``greedy`` after it."""
    results: dict[str, list[Trained]] = {side: [] for side in SIDES}
    for seed in range(1, seeds + 1):
        for side, train in zip(SIDES, (train_ours, train_sb3), strict=True):
            one = train(seed, episodes, greedy)
            results[side].append(one)
            counts = f"{one.decisions} decisions, {one.updates} updates, {one.wall_s:.0f} s"
            told(f"seed {seed} {side:4}  success {one.success:.2f}, greedy {one.greedy:.2f}; {counts}")
    return {side: {name: _interval(ones, name) for name in ("success", "greedy")} for side, ones in results.items()}


def overlap(one: Interval, other: Interval) -> bool:
    """Do the intervals of two means have a point in common? Of one seed: are they equal?"""
    lows, highs = (
        [x if x is not None else i.mean for x, i in zip(ends, (one, other), strict=True)]
        for ends in ((one.low, other.low), (one.high, other.high))
    )
    return max(lows) <= min(highs)


def main() -> int:
    """Print a line a seed and side, then the intervals."""
    parser = argparse.ArgumentParser(
        description="Our TD3 beside stable-baselines3's.",
        epilog="example: python -m mission.training.compare_sb3 --seeds 5 --json",
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=60)
    parser.add_argument("--greedy", type=int, default=10, help="flights after training")
    parser.add_argument("--json", action="store_true", help="one object in place of the last lines")
    asked = parser.parse_args()
    lines = sys.stderr if asked.json else sys.stdout
    found = compare(asked.seeds, asked.episodes, asked.greedy, lambda line: print(line, file=lines, flush=True))
    same = {name: overlap(*(found[side][name] for side in SIDES)) for name in ("success", "greedy")}
    if asked.json:
        rows = {side: {name: asdict(interval) for name, interval in found[side].items()} for side in SIDES}
        print(json.dumps({**rows, "overlap": same}))
    else:
        for name, overlaps in same.items():
            ours, theirs = (_text(found[side][name]) for side in SIDES)
            print(f"{name:8} ours {ours}, sb3 {theirs}: {'overlap' if overlaps else 'apart'}")
    return 0 if all(same.values()) else 1


def _trained(
    env: Flights, act: Callable[[F32], F32], counts: tuple[int, int], episodes: int, greedy: int, wall_s: float
) -> Trained:
    """With the greedy flights, on draws that training has not seen."""
    success = sum(bool(flown["success"]) for flown in env.flown[:episodes]) / episodes
    env.number, env.flown = GREEDY_FIRST, []
    for _ in range(greedy):
        obs, _ = env.reset()
        ended = False
        while not ended:
            obs, _, terminated, truncated, _ = env.step(act(obs))
            ended = terminated or truncated
    won = sum(bool(flown["success"]) for flown in env.flown) / greedy
    return Trained(success, won, *counts, wall_s)


def _sizes(env: Flights) -> tuple[int, int]:
    assert env.observation_space.shape is not None
    assert env.action_space.shape is not None
    return env.observation_space.shape[0], env.action_space.shape[0]


def _interval(ones: list[Trained], name: str) -> Interval:
    found = over_seeds([getattr(one, name) for one in ones])
    assert found is not None
    if found.low is None or found.high is None:
        return found
    return replace(found, low=max(found.low, 0.0), high=min(found.high, 1.0))


def _text(interval: Interval) -> str:
    if interval.low is None or interval.high is None:
        return f"{interval.mean:.2f}"
    return f"{interval.mean:.2f} [{interval.low:.2f}, {interval.high:.2f}]"


if __name__ == "__main__":
    raise SystemExit(main())
