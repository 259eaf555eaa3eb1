"""A heap of whole numbers, smallest first, for kernels: arrays that are filled from the front."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused

__all__ = ["pop", "push", "twice"]


@fused
def twice(heap: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same heap with room for twice as many keys."""
    larger = np.empty(2 * len(heap), np.int64)
    larger[: len(heap)] = heap
    return larger


@fused
def push(heap: NDArray[np.int64], n: int, key: int) -> int:
    """Put a key into a heap of n, smallest first; how many there are now."""
    at = n
    while at and heap[(at - 1) // 2] > key:
        heap[at] = heap[(at - 1) // 2]
        at = (at - 1) // 2
    heap[at] = key
    return n + 1


@fused
def pop(heap: NDArray[np.int64], n: int) -> int:
    """Take the smallest key out of a heap of n; how many there are now."""
    key, at, last = heap[n - 1], 0, n - 1
    while 2 * at + 1 < last:
        child = 2 * at + 1
        if child + 1 < last and heap[child + 1] < heap[child]:
            child += 1
        if heap[child] >= key:
            break
        heap[at] = heap[child]
        at = child
    heap[at] = key
    return last
