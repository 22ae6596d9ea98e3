"""How does a teacher's way become a policy without any reward? Behaviour cloning, by class or by number. Torch.

For the head ``headings`` the labels are chances (n, 41) that sum to one: from the heading of the teacher's path, spread
a little, or from what each heading would cost. For ``continuous`` they are actions (n, 10), only the numbers that the
decoder reads counted. A regression averages left and right; a ranking does not.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from companion.core.types import F64
from companion.policy.actor import Actor
from companion.policy.decoder import ACTION_SIZE, DecoderParams, mirror_action
from companion.policy.headings import headings_rad, mirror_logits
from companion.policy.learned import HEADS
from companion.policy.observations import mirror_observation
from mission.training.networks import actor_net, as_numpy, single_thread

F32 = NDArray[np.float32]

READ = {"detour": 3, "waypoints": ACTION_SIZE}  # numbers of an action that a decoder reads


@dataclass(frozen=True, slots=True)
class Dataset:
    """What was seen and what the teacher said."""

    observations: F32  # (n, size)
    labels: F32  # (n, 41) chances or (n, 10) actions


@dataclass(frozen=True, slots=True)
class CloneConfig:
    """What is cloned, and how."""

    observation: str = "map"
    head: str = "headings"
    decoder: str = "detour"  # of the continuous head
    hidden: tuple[int, ...] = (256, 256)
    steps: int = 3000
    batch: int = 256
    rate: float = 1e-3  # falls to zero along half a cosine
    weight_decay: float = 1e-4
    held_out: float = 0.1  # share of the data that only judges
    mirror: bool = True  # every second row of a batch is mirrored
    device: str = "cpu"


@dataclass(frozen=True, slots=True)
class Clone:
    """The policy, and how well it knows its teacher."""

    actor: Actor
    loss: float  # on what it was trained on, at the end
    held_out_loss: float
    agreement: float  # share of what was held out: the same or a neighbouring heading; or an action within 0.1


def clone(data: Dataset, config: CloneConfig, seed: int) -> Clone:
    """Train an actor on what a teacher said.

    Args:
        data: at least two rows.
        config: sizes and rates.
        seed: of weights, batches and what is held out; the same seed gives the same actor.

    Raises:
        ValueError: where labels and head do not fit.
    """
    outputs = HEADS[config.head]
    if data.labels.shape != (len(data.observations), outputs):
        shape = (len(data.observations), outputs)
        raise ValueError(f"labels of shape {data.labels.shape}, expected {shape} for head '{config.head}'")
    single_thread()
    rng = np.random.default_rng(seed)
    net = actor_net(data.observations.shape[1], outputs, config.hidden, seed)
    net = net.to(config.device)
    order = rng.permutation(len(data.observations))
    judged, learned = np.split(order, [max(1, int(config.held_out * len(order)))])
    optimiser = torch.optim.AdamW(net.parameters(), lr=config.rate, weight_decay=config.weight_decay, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    recent = 0.0
    for _ in range(config.steps):
        rows = learned[rng.integers(len(learned), size=config.batch)]
        loss = _loss(net, *_rows(data, rows, config), config)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        recent += 0.02 * (float(loss.detach()) - recent) if recent else float(loss.detach())
    actor = as_numpy(net)
    with torch.no_grad():
        held_out = float(_loss(net, *_tensors(data, judged, config.device), config))
    return Clone(actor, recent, held_out, _agreement(actor, data, judged, config))


def spread(heading_rad: F64, params: DecoderParams, sigma_rad: float = 0.12) -> F32:
    """Chances (n, 41) about the teacher's headings (n,), a bell about a bin wide."""
    away = headings_rad(params)[None, :] - heading_rad[:, None]
    chances = np.exp(-0.5 * (away / sigma_rad) ** 2)
    return _normed(chances)


def by_cost(cost: F64, temperature: float) -> F32:
    """Chances (n, 41) from what each heading costs to the goal (n, 41), inf where there is no way; one is finite."""
    better = np.exp((cost.min(axis=1, keepdims=True) - cost) / temperature)
    return _normed(better)


def _normed(chances: F64) -> F32:
    normed: F32 = (chances / chances.sum(axis=1, keepdims=True)).astype(np.float32)
    return normed


def _rows(data: Dataset, rows: NDArray[np.int64], config: CloneConfig) -> tuple[Tensor, Tensor]:
    """A batch, half of it mirrored if asked for."""
    if not config.mirror:
        return _tensors(data, rows, config.device)
    observations, labels = data.observations[rows].astype(np.float64), data.labels[rows].astype(np.float64)
    observations[1::2] = mirror_observation(config.observation, observations[1::2])
    headings = config.head == "headings"
    labels[1::2] = mirror_logits(labels[1::2]) if headings else mirror_action(config.decoder, labels[1::2])
    return _tensor(observations, config.device), _tensor(labels, config.device)


def _tensors(data: Dataset, rows: NDArray[np.int64], device: str) -> tuple[Tensor, Tensor]:
    return _tensor(data.observations[rows], device), _tensor(data.labels[rows], device)


def _tensor(rows: NDArray[np.floating], device: str) -> Tensor:
    return torch.from_numpy(rows.astype(np.float32)).to(device)


def _loss(net: nn.Sequential, observations: Tensor, labels: Tensor, config: CloneConfig) -> Tensor:
    output = net(observations)
    if config.head == "headings":
        return functional.cross_entropy(output, labels)
    read = READ[config.decoder]
    return functional.mse_loss(torch.tanh(output[:, :read]), labels[:, :read])


def _agreement(actor: Actor, data: Dataset, rows: NDArray[np.int64], config: CloneConfig) -> float:
    said, taught = actor.forward(data.observations[rows].astype(np.float64)), data.labels[rows]
    if config.head == "headings":
        return float((np.abs(said.argmax(axis=1) - taught.argmax(axis=1)) <= 1).mean())
    read = READ[config.decoder]
    return float((np.abs(np.tanh(said[:, :read]) - taught[:, :read]) <= 0.1).all(axis=1).mean())
