"""What does the network say? Forward pass of a small fully connected net in numpy; pure.

The drone has no torch: a test ties this to the network that was trained.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64

F32 = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Actor:
    """Weights (out, in) and biases (out,) layer by layer; ReLU between layers."""

    weights: tuple[F32, ...]
    biases: tuple[F32, ...]

    def forward(self, observation: F64) -> F64:
        """Output of the last layer, before any squashing, for one observation (n,) or many (m, n)."""
        values = np.asarray(observation, np.float32)
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            values = values @ weight.T + bias
            if layer < last:
                np.maximum(values, np.float32(0.0), out=values)
        return values.astype(np.float64)

    def sizes(self) -> tuple[int, ...]:
        """Numbers in, of each hidden layer, and out."""
        return (self.weights[0].shape[1], *(len(bias) for bias in self.biases))


def from_arrays(arrays: Mapping[str, F32]) -> Actor:
    """The actor kept under ``layer<k>.weight`` and ``layer<k>.bias``. Raises KeyError naming what is missing."""
    layers = range(len(arrays) // 2)
    weights = tuple(arrays[f"layer{k}.weight"] for k in layers)
    return Actor(weights, tuple(arrays[f"layer{k}.bias"] for k in layers))


def arrays(actor: Actor) -> dict[str, F32]:
    """The inverse of ``from_arrays``."""
    named: dict[str, F32] = {}
    for k, (weight, bias) in enumerate(zip(actor.weights, actor.biases, strict=True)):
        named[f"layer{k}.weight"], named[f"layer{k}.bias"] = weight, bias
    return named


def squashed(output: F64) -> F64:
    """An action in [-1, 1] from the output of an actor."""
    return np.tanh(output)
