"""How does a net go down a slope? Adam (Kingma 2015) on all its weights as one vector; torch.

Small nets spend their time between kernels: one vector takes a few calls a step, a list of weights takes a hundred.
"""

from typing import Any

import torch
from torch import Tensor, nn

KEEP_MEAN, KEEP_SQUARE, LEAST = 0.9, 0.999, 1e-8  # beta 1, beta 2, epsilon of the paper


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
        self._mean, self._square = torch.zeros_like(self.weights), torch.zeros_like(self.weights)
        self._steps = torch.zeros((), device=self.weights.device)
        self._rate = 0.0

    def step(self, loss: Tensor, rate: float) -> None:
        """One step; slopes of this net alone, whatever else the loss went through."""
        slope = torch.cat([part.reshape(-1) for part in torch.autograd.grad(loss, self._parameters)])
        self._steps, self._rate = self._steps + 1.0, rate
        torch._fused_adam_(
            [self.weights], [slope], [self._mean], [self._square], [], [self._steps],
            lr=rate, beta1=KEEP_MEAN, beta2=KEEP_SQUARE, eps=LEAST, weight_decay=0.0, amsgrad=False, maximize=False,
        )  # fmt: skip

    def state_dict(self) -> dict[str, Any]:
        """Moments, steps and the rate of the last one."""
        return {"mean": self._mean.clone(), "square": self._square.clone(), "steps": self._steps, "rate": self._rate}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """As it was when ``state_dict`` was called."""
        self._mean.copy_(state["mean"])
        self._square.copy_(state["square"])
        self._steps, self._rate = state["steps"].to(self._steps), float(state["rate"])
