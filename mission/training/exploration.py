"""How does a policy in training try something else? Both ways of the paper; in waypoint space, never at the motors.

* ``geometric`` (eq. geom_eps): bounded offsets to the five pairs of the action, eps_t * dw, |dw| <= rho.
* ``epsilon_greedy``: with probability eps a vector drawn evenly from [-1, 1]^d takes the action's place, its first
  numbers (side and curvature) scaled.

eps falls by a factor an episode. What was drawn lasts for ``hold`` decisions: a detour that is over in a fraction of a
second leads out of nothing.
"""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
State = dict[str, Any]

KINDS = ("geometric", "epsilon_greedy")


@dataclass(frozen=True, slots=True)
class ExplorationConfig:
    """How much, for how long."""

    kind: str = "epsilon_greedy"
    epsilon_first: float = 1.0
    epsilon_least: float = 0.05
    decay: float = 0.98  # lambda, an episode; the paper: 0.995
    radius: float = 1.0  # rho, of ``geometric``, as a share of the action's range
    scales: tuple[float, ...] = (1.5, 1.5)  # of ``epsilon_greedy``: of the first numbers; beyond 1 is cut
    at_entry_only: bool = False  # ``epsilon_greedy``: draw only where RL mode was just entered, as the paper
    hold: int = 6  # decisions that a draw lasts, whatever came of it

    def __post_init__(self) -> None:
        """Raise ValueError for what cannot be."""
        if self.kind not in KINDS:
            raise ValueError(f"exploration kind = {self.kind!r}, expected one of {', '.join(KINDS)}")
        if not (0.0 < self.decay <= 1.0 and 0.0 <= self.epsilon_least <= self.epsilon_first <= 1.0 and self.hold >= 1):
            raise ValueError("exploration wants 0 < decay <= 1, 0 <= epsilon_least <= epsilon_first <= 1, hold >= 1")


class Exploration:
    """Draws from its own generator."""

    def __init__(self, config: ExplorationConfig, action_dim: int, seed: int) -> None:
        self._config = config
        self._dim = action_dim
        self._rng = np.random.default_rng(seed)
        self._episode = 0
        self._drawn: F32 | None = None  # None: greedy
        self._left = 0  # decisions for which that holds

    @property
    def epsilon(self) -> float:
        """How much it explores in this episode."""
        config = self._config
        return max(config.epsilon_least, config.epsilon_first * config.decay**self._episode)

    def start_episode(self, episode: int) -> None:
        """Episodes are counted from 0."""
        self._episode, self._left = episode, 0

    def explore(self, greedy: F32, info: dict[str, Any]) -> F32:
        """The action to fly. ``info["entered"]``: this decision is the first since RL mode was entered."""
        if self._config.kind == "geometric":
            return self._offset(greedy)
        entered = bool(info["entered"])
        if entered or (self._left == 0 and not self._config.at_entry_only):
            self._drawn = self._uniform() if self._rng.random() < self.epsilon else None
            self._left = self._config.hold
        action = greedy if self._left == 0 or self._drawn is None else self._drawn
        self._left = max(self._left - 1, 0)
        return action

    def state_dict(self) -> State:
        """All that decides the next draw."""
        return {
            "generator": json.dumps(self._rng.bit_generator.state),
            "episode": self._episode,
            "drawn": None if self._drawn is None else self._drawn.copy(),
            "left": self._left,
        }

    def load_state_dict(self, state: State) -> None:
        """As it was."""
        self._rng.bit_generator.state = json.loads(state["generator"])
        self._episode, self._left = int(state["episode"]), int(state["left"])
        self._drawn = None if state["drawn"] is None else np.asarray(state["drawn"], np.float32)

    def _offset(self, greedy: F32) -> F32:
        """eps * dw on top of the action, dw even in the disc of radius rho for each pair of numbers."""
        if self._left == 0 or self._drawn is None:
            pairs = self._dim // 2
            angle, share = self._rng.uniform(0.0, 2.0 * np.pi, pairs), np.sqrt(self._rng.random(pairs))
            disc = np.stack([share * np.cos(angle), share * np.sin(angle)], axis=1)
            self._drawn = (self._config.radius * disc).ravel().astype(np.float32)
            self._left = self._config.hold
        self._left -= 1
        moved: F32 = np.clip(greedy + np.float32(self.epsilon) * self._drawn, -1.0, 1.0)
        return moved

    def _uniform(self) -> F32:
        drawn = self._rng.uniform(-1.0, 1.0, self._dim)
        scales = self._config.scales[: self._dim]
        drawn[: len(scales)] *= scales
        return np.clip(drawn, -1.0, 1.0).astype(np.float32)
