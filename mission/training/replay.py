"""Which transitions are learned from? A ring of them, sampled by priority (eq. per), by LAP, or evenly.

* ``per`` (Schaul 2016, as in the paper): P(i) = p_i^alpha / sum, p = |TD error|; importance weights (1 / (N P))^beta,
  over the largest of the batch; beta annealed to 1; new samples get p_max, the largest |TD error| of the last update.
* ``lap`` (Fujimoto 2020): p = max(|TD error|, 1), no weights; belongs to a Huber loss in the critics.
* ``uniform``.
"""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64
from mission.training.sum_tree import Index, SumTree

F32 = NDArray[np.float32]
State = dict[str, Any]

KINDS = ("per", "lap", "uniform")
LEAST_PRIORITY = 1e-6  # of PER: what was predicted well may come again
LAP_LEAST = 1.0  # of LAP: where its Huber loss turns linear


@dataclass(frozen=True, slots=True)
class ReplayConfig:
    """Exponents."""

    alpha: float = 0.6  # how much priority counts; 0.4 for LAP in its paper
    beta_first: float = 0.4
    beta_last: float = 1.0
    beta_batches: int = 10_000  # sampled until beta is at its last

    def __post_init__(self) -> None:
        """Raise ValueError naming what is out of range."""
        for name in ("alpha", "beta_first", "beta_last"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"'{name}' = {getattr(self, name)} is outside [0, 1]")
        if self.beta_batches < 1:
            raise ValueError(f"'beta_batches' = {self.beta_batches} wants at least 1")


@dataclass(frozen=True, slots=True)
class Batch:
    """Transitions, one a row."""

    indices: Index  # (n,)
    weights: F64  # (n,) at most 1
    obs: F32  # (n, obs_dim)
    action: F32  # (n, action_dim)
    reward: F32  # (n,)
    next_obs: F32  # (n, obs_dim)
    discount: F32  # (n,) of what comes after the decision
    terminated: F32  # (n,) 1: nothing comes after


class Replay:
    """The memory."""

    def __init__(
        self, kind: str, capacity: int, obs_dim: int, action_dim: int, config: ReplayConfig, seed: int
    ) -> None:
        """Raises ValueError for an unknown kind."""
        if kind not in KINDS:
            raise ValueError(f"replay = {kind!r}, expected one of {', '.join(KINDS)}")
        self.kind, self.config = kind, config
        self._rows = {
            "obs": np.zeros((capacity, obs_dim), np.float32),
            "action": np.zeros((capacity, action_dim), np.float32),
            "reward": np.zeros(capacity, np.float32),
            "next_obs": np.zeros((capacity, obs_dim), np.float32),
            "discount": np.zeros(capacity, np.float32),
            "terminated": np.zeros(capacity, np.float32),
        }
        self._capacity = capacity
        self._tree = SumTree(capacity)
        self._size, self._next, self._batches = 0, 0, 0
        self._p_max = 1.0
        self._rng = np.random.default_rng(seed)

    def __len__(self) -> int:
        return self._size

    @property
    def beta(self) -> float:
        """Of the next batch."""
        done = min(self._batches / self.config.beta_batches, 1.0)
        return self.config.beta_first + done * (self.config.beta_last - self.config.beta_first)

    def add(self, obs: F32, action: F32, reward: float, next_obs: F32, discount: float, terminated: bool) -> None:
        """One transition, in the place of the oldest when full; it will be sampled soon."""
        values: tuple[Any, ...] = (obs, action, reward, next_obs, discount, terminated)
        for rows, value in zip(self._rows.values(), values, strict=True):
            rows[self._next] = value
        if self.kind != "uniform":
            self._tree.set(np.array([self._next]), np.array([self._p_max**self.config.alpha]))
        self._next = (self._next + 1) % self._capacity
        self._size = min(self._size + 1, self._capacity)

    def sample(self, batch: int) -> Batch:
        """So many transitions, with repetition. There must be one."""
        if self.kind == "uniform":
            indices, weights = self._rng.integers(self._size, size=batch), np.ones(batch)
        else:
            indices, weights = self._by_priority(batch)
        self._batches += 1
        return Batch(indices, weights, **{name: rows[indices] for name, rows in self._rows.items()})

    def update_priorities(self, indices: Index, td_errors: F64) -> None:
        """What an update said of a batch: |TD error| (n,)."""
        if self.kind == "uniform":
            return
        priorities = np.maximum(np.abs(td_errors), LAP_LEAST if self.kind == "lap" else LEAST_PRIORITY)
        self._tree.set(indices, priorities**self.config.alpha)
        self._p_max = float(priorities.max())

    def state_dict(self) -> State:
        """All of it, arrays only as long as they are filled."""
        filled = np.arange(self._size)
        return {
            "rows": {name: rows[: self._size].copy() for name, rows in self._rows.items()},
            "weights": self._tree.get(filled),
            "size": self._size,
            "next": self._next,
            "batches": self._batches,
            "p_max": self._p_max,
            "generator": json.dumps(self._rng.bit_generator.state),
        }

    def load_state_dict(self, state: State) -> None:
        """As it was. Raises ValueError if it was another size."""
        size = int(state["size"])
        if size > self._capacity:
            raise ValueError(f"replay capacity = {self._capacity}, but {size} transitions were saved")
        for name, rows in self._rows.items():
            rows[:size] = state["rows"][name]
        self._tree = SumTree(self._capacity)
        self._tree.set(np.arange(size), np.asarray(state["weights"]))
        self._size, self._next, self._batches = size, int(state["next"]), int(state["batches"])
        self._p_max = float(state["p_max"])
        self._rng.bit_generator.state = json.loads(state["generator"])

    def _by_priority(self, batch: int) -> tuple[Index, F64]:
        """One index from each of ``batch`` equal parts of the running sum, and its weight."""
        shares = (np.arange(batch) + self._rng.random(batch)) * (self._tree.total / batch)
        indices = self._tree.find(shares)
        if self.kind == "lap":
            return indices, np.ones(batch)
        chance = self._tree.get(indices) / self._tree.total
        weights = (self._size * chance) ** -self.beta
        return indices, weights / weights.max()
