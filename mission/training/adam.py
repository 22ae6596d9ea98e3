"""How does a net go down a slope quickly? torch's Adam, on all its weights as one vector.

Small nets spend their time between kernels: one vector takes a few calls a step, a list of weights takes a hundred.
"""

from copy import deepcopy
from typing import Any

import torch
from torch import Tensor, nn


def side_by_side(net: nn.Module) -> Tensor:
    """All weights of a net as one vector (n,): from now on they are views of it."""
    parameters = list(net.parameters())
    vector = torch.cat([parameter.detach().reshape(-1) for parameter in parameters])
    parts = vector.split([parameter.numel() for parameter in parameters])
    for parameter, part in zip(parameters, parts, strict=True):
        parameter.data = part.view_as(parameter)
    return vector


class Adam:
    """Steps of one net; its state and the net's are all that decides the next one."""

    def __init__(self, net: nn.Module) -> None:
        self._parameters = list(net.parameters())
        self.weights = side_by_side(net)
        self._optimiser = torch.optim.Adam([self.weights], fused=True)

    def step(self, loss: Tensor, rate: float) -> None:
        """One step; slopes of this net alone, whatever else the loss went through."""
        slopes = torch.autograd.grad(loss, self._parameters)
        self.weights.grad = torch.cat([slope.reshape(-1) for slope in slopes])
        self._optimiser.param_groups[0]["lr"] = rate
        self._optimiser.step()

    def state_dict(self) -> dict[str, Any]:
        """Moments, steps and the rate of the last one."""
        return deepcopy(self._optimiser.state_dict())

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """As it was when ``state_dict`` was called."""
        self._optimiser.load_state_dict(state)
