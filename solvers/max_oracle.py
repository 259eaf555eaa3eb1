"""Maximisers of score plus loss for max-margin learning: a fast one, and a certified one."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.solvers.expansion import ExpansionGraph
from pgm_places.solvers.max_margin import MaxMarginProblem, Oracle


def problem_oracle(problem: MaxMarginProblem, *, from_last: bool = False) -> Oracle:
    """:func:`graph_cut_oracle` of a problem's graph, with the nodes of sets where it has some."""
    whole = graph_cut_oracle(problem.n_whole, problem.whole_edges, from_last=from_last)
    return lambda unary, agreement: whole(unary, agreement)[: problem.n_nodes]


def graph_cut_oracle(n_nodes: int, edges: NDArray[np.int32], *, from_last: bool = False) -> Oracle:
    """Alpha-expansion on one graph: exact for two labels, near the best for more.

    The returned function is not for two threads at a time.

    Parameters
    ----------
    n_nodes : int
    edges : (E, 2) int
        Node pairs.
    from_last : bool
        Start from the last call's answer instead of the best unaries: fewer moves while the
        weights change little, but what one call missed the next ones are likely to miss too.
    """
    graph = ExpansionGraph(n_nodes, edges)
    last: NDArray[np.int64] | None = None

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        nonlocal last
        labels = graph.expand(unary, agreement, last).labels
        if from_last:
            last = labels
        return labels

    return best
