"""Which functions does TD3 learn? An actor, and two critics computed as one. Torch; the seed decides all weights.

The actor ends before any squashing: ten numbers for a decoder (tanh comes after), or one for each heading.
"""

import itertools
import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from companion.policy.actor import Actor


def single_thread() -> None:
    """One thread a process: small nets gain nothing from more, and seeds train side by side."""
    torch.set_num_threads(1)


def actor_net(inputs: int, outputs: int, hidden: Sequence[int], seed: int, zero_last: bool = False) -> nn.Sequential:
    """Fully connected, ReLU between layers.

    Args:
        inputs: size of the observation.
        outputs: size of the action, or number of headings.
        hidden: sizes of the hidden layers.
        seed: of the weights.
        zero_last: the last layer starts at zero: a ``detour`` then flies straight at the goal.
    """
    sizes = (inputs, *hidden, outputs)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        layers = [nn.Linear(here, there) for here, there in itertools.pairwise(sizes)]
    if zero_last:
        nn.init.zeros_(layers[-1].weight)
        nn.init.zeros_(layers[-1].bias)
    between = [module for layer in layers[:-1] for module in (layer, nn.ReLU())]
    return nn.Sequential(*between, layers[-1])


class TwinCritic(nn.Module):
    """Two critics with a shape in common: their weights lie side by side, and one product serves both."""

    def __init__(self, inputs: int, hidden: Sequence[int], seed: int) -> None:
        """``inputs``: size of observation and action together."""
        super().__init__()
        sizes = (inputs, *hidden, 1)
        generator = torch.Generator().manual_seed(seed)
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for here, there in itertools.pairwise(sizes):
            bound = 1.0 / math.sqrt(here)  # as nn.Linear begins
            for parameters, shape in ((self.weights, (2, here, there)), (self.biases, (2, 1, there))):
                parameters.append(nn.Parameter((2.0 * torch.rand(shape, generator=generator) - 1.0) * bound))
        self._layers = tuple(zip(self.weights, self.biases, strict=True))  # a ParameterList is slow to read

    def forward(self, obs: Tensor, action: Tensor) -> Tensor:
        """Values (2, n) of both critics for n pairs."""
        values = torch.cat((obs, action), dim=1).expand(2, -1, -1)
        last = len(self._layers) - 1
        for layer, (weight, bias) in enumerate(self._layers):
            values = torch.baddbmm(bias, values, weight)
            if layer < last:
                values = torch.relu_(values)
        return values[..., 0]

    def first(self, obs: Tensor, action: Tensor) -> Tensor:
        """Values (n,) of the first critic alone, which the actor climbs."""
        values = torch.cat((obs, action), dim=1)
        last = len(self._layers) - 1
        for layer, (weight, bias) in enumerate(self._layers):
            values = torch.addmm(bias[0], values, weight[0])
            if layer < last:
                values = torch.relu_(values)
        return values[..., 0]


def as_numpy(net: nn.Sequential) -> Actor:
    """A copy of an actor that flies without torch."""
    layers = [module for module in net if isinstance(module, nn.Linear)]
    return Actor(
        tuple(layer.weight.detach().cpu().numpy().copy() for layer in layers),
        tuple(layer.bias.detach().cpu().numpy().copy() for layer in layers),
    )
