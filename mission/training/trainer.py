"""How is one seed trained?  Episodes until enough have succeeded; stopped at any moment, it goes on bit for bit.

Everything that decides what comes next is either in a checkpoint or a function of (seed, episode): the draws of an
episode are, the clock is not. So a run killed at any moment and resumed repeats what it had done since its last
checkpoint, with the same outcome, and ends with the weights of a run that was never killed.
"""

import json
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mission.training.checkpoint import State, fingerprint, load_newest, save, write_whole
from mission.training.metrics import Metrics
from mission.training.parts import F32, Parts
from mission.training.status import Progress, Status
from mission.training.until import TrainingConfig, Until

WINDOW = 15  # episodes of the paper's moving averages
RESULT = "result.json"
PREFILL = 10**9  # the teacher's flights are numbered from here

T = TypeVar("T")


class Trainer:
    """One seed in one folder. ``run`` yields after every episode."""

    def __init__(self, parts: Parts, config: TrainingConfig, until: Until, seed: int, folder: Path) -> None:
        """Continues where the newest good checkpoint in ``folder`` ends. Raises FlightError when none is good."""
        folder.mkdir(parents=True, exist_ok=True)
        self._parts, self._config, self._until = parts, config, until
        self._seed, self._folder = seed, folder
        self._watch = parts.stopwatch
        self._recent: deque[tuple[int, float, float]] = deque(maxlen=WINDOW)  # success, steps, return
        self.progress = Progress()
        self.note = ""
        loaded = load_newest(folder)
        self._metrics = Metrics(folder, None if loaded is None else loaded.state["sizes"])
        self._begun = loaded is not None
        if loaded is not None:
            self._take(loaded.state)
            self.note = "; ".join(loaded.refused)

    @property
    def finished(self) -> bool:
        """Nothing is left to do."""
        progress, until = self.progress, self._until
        enough = progress.successes >= until.successes
        return enough or progress.episodes >= until.episodes or progress.ticks >= until.ticks

    def run(self) -> Iterator[Status]:
        """Train to the end. Raises FlightError where a checkpoint cannot be written."""
        with self._watch.part("rest"):
            if not self._begun:
                self._prefill()
                self._evaluate()
                self._save()
            while not self.finished:
                self._episode()
                if self.finished or self._due(self._config.evaluate_every):
                    self._evaluate()
                if self.finished or self._due(self._config.checkpoint_every):
                    self._save()
                if not self.finished:
                    yield self.status()
        self._finish()
        yield self.status()

    def status(self) -> Status:
        """Where it stands."""
        seconds = self._watch.seconds
        wall_s = sum(spent_s for name, spent_s in seconds.items() if name != "evaluation")
        return Status(
            self._seed,
            "done" if self.finished else "training",
            self.progress,
            _mean([steps for _, steps, _ in self._recent]),
            _mean([total for _, _, total in self._recent]),
            self.progress.decisions / wall_s if wall_s else 0.0,
            wall_s,
            self._time_left_s(wall_s),
            {name: spent_s / wall_s for name, spent_s in seconds.items() if name != "evaluation"} if wall_s else {},
            self.note,
        )

    def _episode(self) -> None:
        """One episode with its updates, and its rows."""
        parts, number = self._parts, self.progress.episodes
        parts.explorer.start_episode(number)
        obs, info = self._reset(number)
        total, figures, ended = 0.0, _Means(), False
        while not ended:
            action = parts.explorer.explore(parts.learner.act(obs), info)
            next_obs, info, reward, ended = self._step(obs, action)
            total, obs = total + reward, next_obs
            self.progress = replace(self.progress, decisions=self.progress.decisions + 1)
            if len(parts.memory) >= self._config.warmup_decisions:
                with self._watch.part("updates"):
                    self._update(figures)
        self._account(info, total, figures)

    def _reset(self, number: int) -> tuple[F32, dict[str, Any]]:
        seed = episode_seed(self._seed, number)
        obs, info = self._flown(lambda: self._parts.env.reset(seed=seed))
        return obs, info

    def _step(self, obs: F32, action: F32) -> tuple[F32, dict[str, Any], float, bool]:
        """Fly one decision and keep the transition: the next observation, info, reward, whether it was the last."""
        parts = self._parts
        next_obs, gained, terminated, truncated, info = self._flown(lambda: parts.env.step(action))
        reward, discount = float(gained), float(info["discount"])
        parts.memory.add(obs, action, reward, next_obs, discount, terminated)
        return next_obs, info, reward, terminated or truncated

    def _flown(self, fly: Callable[[], T]) -> T:
        """What the environment answers; its wall time counts as the navigator's but for the physics in it."""
        before_s = self._parts.physics_s()
        with self._watch.part("navigator"):
            answer = fly()
        self._watch.move(self._parts.physics_s() - before_s, "navigator", "physics")
        return answer

    def _prefill(self) -> None:
        """Flights of the teacher, kept before the first episode."""
        parts = self._parts
        if parts.teacher is None:
            return
        for flight in range(self._config.prefill_flights):
            obs, info = self._reset(PREFILL + flight)
            ended = False
            while not ended:
                obs, info, _, ended = self._step(obs, parts.teacher(info))

    def _update(self, figures: "_Means") -> None:
        parts = self._parts
        for _ in range(self._config.updates_per_decision):
            batch = parts.memory.sample(self._config.batch)
            outcome = parts.learner.update(batch if parts.mirror is None else parts.mirror(batch))
            parts.memory.update_priorities(batch.indices, outcome["td_errors"])
            figures.add(outcome)
        self.progress = replace(self.progress, updates=self.progress.updates + self._config.updates_per_decision)

    def _account(self, info: dict[str, Any], total: float, figures: "_Means") -> None:
        flown = dict(info["episode"])
        track = flown.pop("track_ne_m", None)
        success = bool(flown["success"])
        self.progress = replace(
            self.progress,
            episodes=self.progress.episodes + 1,
            successes=self.progress.successes + success,
            ticks=self.progress.ticks + int(flown.get("ticks", 0)),
        )
        total = float(flown.get("return", total))
        self._recent.append((success, float(flown["steps"]), total))
        number = self.progress.episodes
        counts = {"episode": number, "successes": self.progress.successes, "epsilon": self._parts.explorer.epsilon}
        self._metrics.add("episodes", {**counts, **_plain(flown), "return": total})
        if figures.count:
            self._metrics.add("updates", {"episode": number, "updates": self.progress.updates, **figures.means()})
        if track is not None:
            self._metrics.add("tracks", {"episode": number, "track_ne_m": _plain(track)})

    def _evaluate(self) -> None:
        if self._parts.evaluate is None or self._config.evaluate_every == 0:
            return
        with self._watch.part("evaluation"):
            row = self._parts.evaluate(self.progress.episodes)
        self._metrics.add("evaluations", {"episode": self.progress.episodes, **_plain(row)})

    def _due(self, every: int) -> bool:
        return every > 0 and self.progress.episodes % every == 0

    def _save(self) -> None:
        parts = self._parts
        state = {
            "progress": asdict(self.progress),
            "recent": [list(row) for row in self._recent],
            "seconds": dict(self._watch.seconds),
            "sizes": self._metrics.flush(),
            "learner": parts.learner.state_dict(),
            "memory": parts.memory.state_dict(),
            "explorer": parts.explorer.state_dict(),
        }
        save(self._folder, self.progress.episodes, state)

    def _take(self, state: State) -> None:
        self.progress = Progress(**state["progress"])
        self._recent.extend((int(s), float(n), float(r)) for s, n, r in state["recent"])
        self._watch.seconds.update(state["seconds"])
        self._parts.learner.load_state_dict(state["learner"])
        self._parts.memory.load_state_dict(state["memory"])
        self._parts.explorer.load_state_dict(state["explorer"])

    def _finish(self) -> None:
        self._metrics.flush()
        self._metrics.close()
        weights = fingerprint(self._parts.learner.state_dict())
        result = {
            "seed": self._seed,
            **asdict(self.progress),
            "weights_sha256": weights,
            "seconds": self._watch.seconds,
        }
        write_whole(self._folder / RESULT, json.dumps(result, indent=1).encode())

    def _time_left_s(self, wall_s: float) -> float | None:
        """By the pace of the last episodes; None before there is one."""
        if self.finished:
            return 0.0
        rate = sum(success for success, _, _ in self._recent) / max(len(self._recent), 1)
        if not self.progress.episodes:
            return None
        left = self._until.episodes - self.progress.episodes
        if self.progress.ticks:
            per_episode = self.progress.ticks / self.progress.episodes
            left = min(left, math.ceil((self._until.ticks - self.progress.ticks) / per_episode))
        if rate > 0.0:
            left = min(left, round((self._until.successes - self.progress.successes) / rate))
        return left * wall_s / self.progress.episodes


def episode_seed(seed: int, episode: int) -> int:
    """The draws of an episode (counted from 0) of a seed's training."""
    return int(np.random.SeedSequence([seed, episode]).generate_state(1)[0])


class _Means:
    """Means of the single numbers among the figures of several updates."""

    def __init__(self) -> None:
        self.count = 0
        self._sums: dict[str, float] = {}
        self._counts: dict[str, int] = {}

    def add(self, outcome: dict[str, Any]) -> None:
        self.count += 1
        for name, value in outcome.items():
            if isinstance(value, int | float):
                self._sums[name] = self._sums.get(name, 0.0) + float(value)
                self._counts[name] = self._counts.get(name, 0) + 1

    def means(self) -> dict[str, float]:
        return {name: total / self._counts[name] for name, total in self._sums.items()}


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else 0.0


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as JSON has them; infinite and NaN as null."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not np.isfinite(value) else value
