"""Observed labels as constraints: scores with all other labels forbidden."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def keep_known(scores: NDArray[np.float64], known: NDArray[np.int64] | None) -> NDArray[np.float64]:
    """(M, K) scores with all but the known label of the first N nodes forbidden.

    ``known`` (N,) is -1 where unknown. Further nodes may follow the N nodes of the graph.
    """
    nodes = np.zeros(0, np.int64) if known is None else np.flatnonzero(known >= 0)
    if known is None or not len(nodes):
        return scores
    clamped = np.array(scores)
    clamped[nodes] = -np.inf
    clamped[nodes, known[nodes]] = scores[nodes, known[nodes]]
    return clamped


def known_beside(parts: Sequence[tuple[NDArray[np.int64] | None, int]]) -> NDArray[np.int64] | None:
    """Known labels of the union of several graphs, each with its number of nodes."""
    if all(known is None for known, _ in parts):
        return None
    return np.concatenate(
        [np.full(n_nodes, -1, np.int64) if known is None else known for known, n_nodes in parts]
    )
