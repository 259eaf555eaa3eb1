"""Labels that are told: whatever is asked of a graph, these nodes keep theirs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def keeping(unary: NDArray[np.float64], told: NDArray[np.int64] | None) -> NDArray[np.float64]:
    """(M, K) the unary with all but the told label of the first N nodes forbidden.

    ``told`` (N,) is -1 where nothing is told; None tells nothing, and the array itself comes back.

    Examples
    --------
    >>> keeping(np.zeros((2, 2)), np.array([-1, 1])).tolist()
    [[0.0, 0.0], [-inf, 0.0]]
    """
    if told is None:
        return unary
    found = unary.copy()
    nodes = np.flatnonzero(told >= 0)
    found[nodes] = -np.inf
    found[nodes, told[nodes]] = unary[nodes, told[nodes]]
    return found


def told_beside(
    parts: Sequence[tuple[NDArray[np.int64] | None, int]],
) -> NDArray[np.int64] | None:
    """What is told of several graphs side by side, each with its number of nodes."""
    if all(told is None for told, _ in parts):
        return None
    return np.concatenate(
        [np.full(n_nodes, -1, np.int64) if told is None else told for told, n_nodes in parts]
    )
