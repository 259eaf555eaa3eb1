"""Log-probabilities of many nodes as probabilities."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.exponential import exponential
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lane_access import load_at, store_at
from pgm_places.kernels.lanes import LANES

NODES_AT_ONCE = 512  # whose numbers stay in the nearest cache


@njit
def normalise(unary: NDArray[np.float64], floor: float, out: NDArray[np.float64]) -> int:
    """Write the probabilities of all nodes to ``out`` (1, N K + 16), one node's behind the other's.

    Those that are not 0 are raised to ``floor``. Returns the first node whose labels are all
    forbidden, or -1; it and later nodes are left out then.
    """
    n_nodes, n_labels = unary.shape
    for begin in range(0, n_nodes, NODES_AT_ONCE):
        end = min(begin + NODES_AT_ONCE, n_nodes)
        for i in range(begin, end):
            best = -np.inf
            for k in range(n_labels):
                best = max(best, unary[i, k])
            if best == -np.inf:
                return i
            for k in range(n_labels):
                out[0, i * n_labels + k] = unary[i, k] - best
        for at in range(begin * n_labels, end * n_labels, LANES):
            store_at(out, 0, at, exponential(load_at(out, 0, at)))
        for i in range(begin, end):
            _divide(out, i * n_labels, n_labels)
            if floor > 0.0:
                for k in range(n_labels):
                    if unary[i, k] > -np.inf:
                        out[0, i * n_labels + k] = max(out[0, i * n_labels + k], floor)
                _divide(out, i * n_labels, n_labels)
    return -1


@njit
def _divide(row: NDArray[np.float64], first: int, count: int) -> None:
    """Divide some numbers of a row by their sum."""
    total = 0.0
    for k in range(first, first + count):
        total += row[0, k]
    factor = 1.0 / total
    for k in range(first, first + count):
        row[0, k] *= factor
