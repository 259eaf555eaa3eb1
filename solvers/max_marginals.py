"""Max-marginals of a forest: the best score of any labelling that gives a node a certain label."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import frozen
from pgm_places._core import pass_back, pass_forest
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.belief_propagation import heard_from_all
from pgm_places.solvers.forest import forest_maximum, ordered_forest


def max_marginals(
    unary: ArrayLike,
    edges: ArrayLike | Adjacency,
    agreement: ArrayLike | None = None,
    pairwise: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """(N, K) the largest score of a labelling in which the node has the label; -inf for none.

    Parameters and errors are those of :func:`pgm_places.solvers.forest.forest_maximum`.

    Examples
    --------
    >>> max_marginals([[1.0, 0.0], [0.0, 0.4]], [(0, 1)], [[0.5, 0.5]]).tolist()
    [[1.5, 0.9], [1.5, 1.4]]
    """
    best = forest_maximum(unary, edges, agreement, pairwise)
    model, order, parent = ordered_forest(unary, edges, agreement, pairwise)
    message = np.zeros((2 * model.around.n_edges, model.n_labels))
    shares = np.empty(model.n_nodes)
    pass_forest(True, model.terms, model.around.arcs, order, parent, message, shares)
    pass_back(True, model.terms, model.around.arcs, order, parent, message)
    heard = heard_from_all(model, message)
    return frozen(best.score + heard - heard.max(axis=1, keepdims=True))
