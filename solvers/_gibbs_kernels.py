"""Kernels of Gibbs sampling."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms, add_edge

__all__ = ["gibbs_sweep"]


@njit
def gibbs_sweep(
    terms: Terms, arcs: Arcs, chance: NDArray[np.float64], labels: NDArray[np.int32]
) -> None:
    """Draw every node in turn given its neighbours; ``chance`` (N,) in [0, 1).

    ``labels`` (N,) must be allowed, and stay so: every label that a node may keep has a chance.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    n_nodes, n_labels = terms.unary.shape
    value = np.empty(n_labels)
    for i in range(n_nodes):
        for k in range(n_labels):
            value[k] = terms.unary[i, k]
        for slot in range(start[i], start[i + 1]):
            add_edge(terms.pairwise, arc[slot], labels[head[slot]], value)
        top = value[0]
        for k in range(1, n_labels):
            if value[k] > top:
                top = value[k]
        total = 0.0
        for k in range(n_labels):
            value[k] = np.exp(value[k] - top)
            total += value[k]
        left = chance[i] * total
        chosen = labels[i]
        for k in range(n_labels):
            if value[k] > 0.0:
                chosen = k
                left -= value[k]
                if left < 0.0:
                    break
        labels[i] = chosen
