"""Relaxation labelling of any graph: one update of all nodes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

MIN_MASS = 1e-12
"""A node whose labels keep less than this together cannot be normalised: it stays as it is."""

SUMS = 3
"""Per task: largest change, sum of changes, sum of p q over labels and nodes."""


class Neighbours(NamedTuple):
    """Adjacency in compressed rows: the entries of node ``i`` are ``start[i]:start[i + 1]``."""

    start: NDArray[np.int64]
    """(N + 1,)."""
    node: NDArray[np.int32]
    """(A,) the neighbour,"""
    weight: NDArray[np.float64]
    """(A,) its weight c_ij,"""
    table: NDArray[np.int8]
    """(A,) and which table of compatibilities counts."""


@njit
def update_nodes(
    old: NDArray[np.float64],
    around: Neighbours,
    tables: NDArray[np.float64],
    damping: float,
    nodes: tuple[int, int],
    out: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Update ``nodes``, the first and the one after the last, from ``old`` (N, K) into ``out``.

    Paper eq. 4 and 5.
    """
    start, node, weight, table = around
    n_labels = old.shape[1]
    seen = np.empty((tables.shape[0], n_labels))
    grown = np.empty(n_labels)
    sums[:] = 0.0
    for i in range(nodes[0], nodes[1]):
        seen[:] = 0.0
        for e in range(start[i], start[i + 1]):
            for k in range(n_labels):
                seen[table[e], k] += weight[e] * old[node[e], k]
        total = 0.0
        for k in range(n_labels):
            support = 1.0
            for d in range(tables.shape[0]):
                for m in range(n_labels):
                    support += tables[d, k, m] * seen[d, m]
            grown[k] = old[i, k] * max(support, 0.0)
            total += grown[k]
        sums[2] += total - 1.0
        for k in range(n_labels):
            new = old[i, k]
            if total > MIN_MASS:
                new = (1.0 - damping) * grown[k] / total + damping * old[i, k]
            change = abs(new - old[i, k])
            sums[0] = max(sums[0], change)
            sums[1] += change
            out[i, k] = new
