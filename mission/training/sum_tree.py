"""Which index owns this share of the whole? Weights in a binary tree of sums; many at once, level by level."""

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64

Index = NDArray[np.int64]


class SumTree:
    """Weights (capacity,), all zero at first. Every sum is that of its two halves, whatever order it came about in."""

    def __init__(self, capacity: int) -> None:
        self._levels = max(1, (capacity - 1).bit_length())
        self._leaf = 1 << self._levels
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
        node = indices + self._leaf
        self._sums[node] = weights
        for _ in range(self._levels):
            node = node >> 1
            self._sums[node] = self._sums[2 * node] + self._sums[2 * node + 1]

    def find(self, shares: F64) -> Index:
        """For each number in [0, total): the index whose stretch of the running sum holds it; never one of weight 0."""
        node = np.ones(len(shares), np.int64)
        rest = shares.copy()
        for _ in range(self._levels):
            node *= 2
            left = self._sums[node]
            right = (rest >= left) & (self._sums[node + 1] > 0.0)
            rest -= left * right
            node += right
        return node - self._leaf
