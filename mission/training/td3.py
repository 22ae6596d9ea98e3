"""How does the policy improve from transitions? TD3 (eqs. td3_target, td3_soft; algorithm td3_per), one file.

Clipped double Q, delayed actor, target smoothing, soft targets. A transition is one RL decision that lasted some ticks,
so it carries its own discount: y = r + discount * (1 - terminated) * min Q'. What the paper does not have: a penalty on
the actor's output before tanh, without which the actions run into their bounds and stay there; a number of updates in
which only the critics learn; rates that fall, and a running average of the actor that flies in its place once trained,
because an actor late in training goes to and fro between good and bad. State is complete: saved and loaded at any
update, training goes on bit for bit.
"""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from companion.policy.actor import Actor
from mission.training.adam import Adam, side_by_side
from mission.training.networks import TwinCritic, actor_net, as_numpy, single_thread
from mission.training.replay import Batch

F32 = NDArray[np.float32]
State = dict[str, Any]

SATURATED = 0.95  # an action beyond this is counted as run into its bound
LEAST_RATE = 0.1  # of the first rate, where rates fall


@dataclass(frozen=True, slots=True)
class TD3Config:
    """What decides an update, besides the batch."""

    hidden: tuple[int, ...] = (256, 256)
    actor_rate: float = 5e-4
    critic_rate: float = 5e-4
    tau: float = 0.005  # eq. td3_soft
    smoothing_sigma: float = 0.2  # eq. td3_target
    smoothing_clip: float = 0.5
    actor_every: int = 2  # d: updates of the critics for one of the actor and the targets
    actor_after: int = 0  # updates before the actor begins to learn
    saturation_penalty: float = 0.3  # times the mean square of the actor's output before tanh
    reward_scale: float = 0.01  # rewards as the critics see them: of order one
    rates_fall_over: int = 0  # updates in which both rates fall evenly to a tenth; 0: they stay
    average: float = 0.0  # how far, an update of the actor, what flies follows what learns; 0: what learns flies
    huber: bool = False  # critic loss linear beyond 1: belongs to ``replay: lap``
    zero_last: bool = True  # the untrained actor says zero
    device: str = "cpu"

    def __post_init__(self) -> None:
        """Raise ValueError naming what is out of range."""
        if min(self.hidden, default=1) < 1:
            raise ValueError(f"'hidden' = {list(self.hidden)} wants layers of at least 1")
        for name in ("tau", "average"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"'{name}' = {getattr(self, name)} is outside [0, 1]")
        for name, most in (("actor_rate", 1.0), ("critic_rate", 1.0), ("reward_scale", np.inf)):
            if not 0.0 < getattr(self, name) <= most:
                raise ValueError(f"'{name}' = {getattr(self, name)} is outside (0, {most:g}]")
        for name, least in (
            ("smoothing_sigma", 0),
            ("smoothing_clip", 0),
            ("saturation_penalty", 0),
            ("actor_after", 0),
            ("rates_fall_over", 0),
            ("actor_every", 1),
        ):
            if not getattr(self, name) >= least:
                raise ValueError(f"'{name}' = {getattr(self, name)} wants at least {least}")


class TD3:
    """Actor, critics, their targets and optimisers."""

    def __init__(self, obs_dim: int, action_dim: int, config: TD3Config, seed: int) -> None:
        """``seed`` decides weights and target noise."""
        single_thread()
        self.config = config
        self._device = torch.device(config.device)
        self._actor = actor_net(obs_dim, action_dim, config.hidden, seed, config.zero_last).to(self._device)
        self._critic = TwinCritic(obs_dim + action_dim, config.hidden, seed + 1).to(self._device)
        self._actor_target, self._critic_target = deepcopy(self._actor), deepcopy(self._critic)
        self._average = deepcopy(self._actor) if config.average else self._actor
        self._actor_optimiser, self._critic_optimiser = Adam(self._actor), Adam(self._critic)
        self._actor_slow, self._critic_slow = side_by_side(self._actor_target), side_by_side(self._critic_target)
        self._average_slow = side_by_side(self._average) if config.average else self._actor_optimiser.weights
        self._generator = torch.Generator(self._device).manual_seed(seed)
        self._updates = 0

    def act(self, obs: F32) -> F32:
        """The greedy action (action_dim,) in [-1, 1] for an observation (obs_dim,)."""
        with torch.no_grad():
            action = torch.tanh(self._actor(torch.as_tensor(obs, dtype=torch.float32, device=self._device)))
        greedy: F32 = action.cpu().numpy()
        return greedy

    def actor(self) -> Actor:
        """A copy of what flies once trained: the actor, or its running average. Without torch."""
        return as_numpy(self._average)

    def update(self, batch: Batch) -> dict[str, Any]:
        """One update.

        Returns:
            ``td_errors`` (n,), absolute, of the first critic; ``critic_loss``, ``q``; and where the actor had its
            turn ``actor_loss``, ``saturated``, the share of actions at their bounds.
        """
        b = self._tensors(batch)
        with torch.no_grad():
            target = self._target(b)
        values = self._critic(b.obs, b.action)
        errors = functional.smooth_l1_loss if self.config.huber else functional.mse_loss
        loss = (errors(values, target.expand_as(values), reduction="none").sum(dim=0) * b.weights).mean()
        self._critic_optimiser.step(loss, self.config.critic_rate * self._rate_left())
        self._updates += 1
        figures = {
            "td_errors": (values[0] - target).detach().abs().cpu().numpy().astype(np.float64),
            "critic_loss": float(loss.detach()),
            "q": float(values.detach().mean()),
        }
        if self._updates % self.config.actor_every == 0:
            if self._updates > self.config.actor_after:
                figures |= self._update_actor(b.obs)
            self._critic_slow.lerp_(self._critic_optimiser.weights, self.config.tau)  # eq. td3_soft
            self._actor_slow.lerp_(self._actor_optimiser.weights, self.config.tau)
        return figures

    def state_dict(self) -> State:
        """All that decides the next update."""
        average = {"average": _copied(self._average.state_dict())} if self.config.average else {}
        return average | {
            "actor": _copied(self._actor.state_dict()),
            "critic": _copied(self._critic.state_dict()),
            "actor_target": _copied(self._actor_target.state_dict()),
            "critic_target": _copied(self._critic_target.state_dict()),
            "actor_optimiser": self._actor_optimiser.state_dict(),
            "critic_optimiser": self._critic_optimiser.state_dict(),
            "generator": self._generator.get_state(),
            "updates": self._updates,
        }

    def load_state_dict(self, state: State) -> None:
        """As it was when ``state_dict`` was called."""
        self._actor.load_state_dict(state["actor"])
        self._critic.load_state_dict(state["critic"])
        self._actor_target.load_state_dict(state["actor_target"])
        self._critic_target.load_state_dict(state["critic_target"])
        if self.config.average:
            self._average.load_state_dict(state["average"])
        self._actor_optimiser.load_state_dict(state["actor_optimiser"])
        self._critic_optimiser.load_state_dict(state["critic_optimiser"])
        self._generator.set_state(state["generator"])
        self._updates = int(state["updates"])

    def _target(self, b: "_Tensors") -> Tensor:
        """y (n,), eq. td3_target with the discount of each transition. Without gradient."""
        noise = torch.randn(b.action.shape, generator=self._generator, device=self._device)
        noise = (noise * self.config.smoothing_sigma).clamp(-self.config.smoothing_clip, self.config.smoothing_clip)
        next_action = (torch.tanh(self._actor_target(b.next_obs)) + noise).clamp(-1.0, 1.0)
        next_value = self._critic_target(b.next_obs, next_action).amin(dim=0)
        return self.config.reward_scale * b.reward + b.discount * (1.0 - b.terminated) * next_value

    def _update_actor(self, obs: Tensor) -> dict[str, float]:
        output = self._actor(obs)
        action = torch.tanh(output)
        penalty = self.config.saturation_penalty * output.square().mean()
        loss = penalty - self._critic.first(obs, action).mean()
        self._actor_optimiser.step(loss, self.config.actor_rate * self._rate_left())
        if self.config.average:
            self._average_slow.lerp_(self._actor_optimiser.weights, self.config.average)
        saturated = (action.detach().abs() > SATURATED).float().mean()
        return {"actor_loss": float(loss.detach()), "saturated": float(saturated)}

    def _rate_left(self) -> float:
        """Share of the first rates for the next step."""
        if not self.config.rates_fall_over:
            return 1.0
        return 1.0 - (1.0 - LEAST_RATE) * min(self._updates / self.config.rates_fall_over, 1.0)

    def _tensors(self, batch: Batch) -> "_Tensors":
        columns = (batch.obs, batch.action, batch.reward, batch.next_obs, batch.discount, batch.terminated)
        weights = batch.weights.astype(np.float32)
        return _Tensors(*(torch.from_numpy(column).to(self._device) for column in (*columns, weights)))


@dataclass(frozen=True, slots=True)
class _Tensors:
    """A batch as torch has it."""

    obs: Tensor  # (n, obs_dim)
    action: Tensor  # (n, action_dim)
    reward: Tensor  # (n,)
    next_obs: Tensor  # (n, obs_dim)
    discount: Tensor  # (n,)
    terminated: Tensor  # (n,) 1 or 0
    weights: Tensor  # (n,)


def _copied(state: State) -> State:
    return {key: value.detach().clone() for key, value in state.items()}
