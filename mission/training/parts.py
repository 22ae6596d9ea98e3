"""What is a seed's training made of?  The sides of learner, memory and exploration that the trainer sees."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from gymnasium import Env
from numpy.typing import NDArray

from mission.training.checkpoint import State
from mission.training.metrics import Row
from mission.training.stopwatch import Stopwatch

F32 = NDArray[np.float32]
Evaluate = Callable[[int], Row]  # greedy flights after that many episodes: {"greedy": {figure: value}, ...}


class Learner(Protocol):
    """What the trainer asks of TD3."""

    def act(self, obs: F32) -> F32:
        """The greedy action."""
        ...

    def update(self, batch: Any) -> dict[str, Any]:
        """One update; its figures, ``td_errors`` (batch,) among them."""
        ...

    def state_dict(self) -> State:
        """All that decides the next update."""
        ...

    def load_state_dict(self, state: State) -> None:
        """As it was."""
        ...


class Memory(Protocol):
    """What the trainer asks of a replay memory."""

    def add(self, obs: F32, action: F32, reward: float, next_obs: F32, discount: float, terminated: bool) -> None:
        """One transition."""
        ...

    def sample(self, batch: int) -> Any:
        """A batch, with ``indices``."""
        ...

    def update_priorities(self, indices: Any, td_errors: Any) -> None:
        """After an update."""
        ...

    def state_dict(self) -> State:
        """All of it."""
        ...

    def load_state_dict(self, state: State) -> None:
        """As it was."""
        ...

    def __len__(self) -> int: ...


class Explorer(Protocol):
    """What the trainer asks of exploration."""

    def start_episode(self, episode: int) -> None:
        """Episodes are counted from 0."""
        ...

    def explore(self, greedy: F32, info: dict[str, Any]) -> F32:
        """The action to fly."""
        ...

    @property
    def epsilon(self) -> float:
        """How much it explores in this episode."""
        ...

    def state_dict(self) -> State:
        """All that decides the next draw."""
        ...

    def load_state_dict(self, state: State) -> None:
        """As it was."""
        ...


def _none() -> float:
    return 0.0


@dataclass(frozen=True, slots=True)
class Parts:
    """One seed, put together."""

    env: Env[F32, F32]
    learner: Learner
    memory: Memory
    explorer: Explorer
    evaluate: Evaluate | None = None
    mirror: Callable[[Any], Any] | None = None  # a batch with half of it mirrored
    teacher: Callable[[dict[str, Any]], F32] | None = None  # what the expert would do now, given the last ``info``
    physics_s: Callable[[], float] = _none  # wall time that the environment has spent in physics so far
    stopwatch: Stopwatch = field(default_factory=Stopwatch)
