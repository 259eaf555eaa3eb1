"""Maximisers of score plus loss for max-margin learning: a quick one, and one with a proof."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.expansion import ExpansionGraph
from pgm_places.solvers.max_margin import Oracle

__all__ = ["graph_cut_oracle"]


def graph_cut_oracle(n_nodes: int, edges: NDArray[np.int32]) -> Oracle:
    """Alpha-expansion on one graph: exact for two labels, near the best for more.

    The returned function is not for two threads at a time.
    """
    graph = ExpansionGraph(n_nodes, edges)

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        return graph.expand(unary, agreement).labels

    return best
