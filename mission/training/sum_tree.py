"""Which index owns this share of the whole? Weights in a binary tree of sums; many at once; compiled."""

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64
from sitl.compiled import compiled

Index = NDArray[np.int64]


class SumTree:
    """Weights (capacity,), all zero at first. Every sum is that of its two halves, whatever order it came about in."""

    def __init__(self, capacity: int) -> None:
        self._leaf = 1 << max(1, (capacity - 1).bit_length())
        self._sums = np.zeros(2 * self._leaf)  # node 1 is the whole; 2k and 2k + 1 are the halves of k

    @property
    def total(self) -> float:
        """Sum of all weights."""
        return float(self._sums[1])

    def get(self, indices: Index) -> F64:
        """Weights at these indices."""
        weights: F64 = self._sums[self._leaf + indices]
        return weights

    def set(self, indices: Index, weights: F64) -> None:
        """New weights; of an index given twice the last one counts."""
        _set(self._sums, self._leaf + indices, weights)

    def find(self, shares: F64) -> Index:
        """For each number in [0, total): the index whose stretch of the running sum holds it; never one of weight 0."""
        return _leaves(self._sums, shares) - self._leaf


@compiled
def _set(sums: F64, nodes: Index, weights: F64) -> None:
    for k in range(len(nodes)):
        node = nodes[k]
        sums[node] = weights[k]
        while node > 1:
            node >>= 1
            sums[node] = sums[2 * node] + sums[2 * node + 1]


@compiled
def _leaves(sums: F64, shares: F64) -> Index:
    nodes = np.empty(len(shares), np.int64)
    for k in range(len(shares)):
        node, rest = 1, shares[k]
        while 2 * node < len(sums):
            node *= 2
            if rest >= sums[node] and sums[node + 1] > 0.0:
                rest -= sums[node]
                node += 1
        nodes[k] = node
    return nodes
