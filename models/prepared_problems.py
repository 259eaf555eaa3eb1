"""Training problems side by side, as learners of linear models take them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.models.completion import LossOf
from pgm_places.models.feature_scaling import Standardization
from pgm_places.solvers.set_terms import SetTerms


class TermSizes(NamedTuple):
    """By what features of edges and cliques are divided while their weights are learned.

    What is learned is then divided by the same, so that it is that of the features as given.
    """

    edges: NDArray[np.float64]
    """(F,)."""
    cliques: NDArray[np.float64]
    """(G,), G = 0 without cliques."""

    def of_weights(self, n_weights: int, n_labels: int, per_edge: int) -> NDArray[np.float64]:
        """(n_weights,) those of flat weights: 1 for nodes, then ``per_edge`` each, then K each."""
        of_edges, of_cliques = np.repeat(self.edges, per_edge), np.repeat(self.cliques, n_labels)
        of_nodes = np.ones(n_weights - len(of_edges) - len(of_cliques))
        return np.concatenate([of_nodes, of_edges, of_cliques])


class PreparedProblems(NamedTuple):
    """The nodes and edges of all problems, with scaled features; N nodes, E edges, K labels."""

    scaling: Standardization
    sizes: TermSizes
    nodes: NDArray[np.float64]
    """(N, D) scaled node features."""
    edges: NDArray[np.int64]
    """(E, 2)."""
    edge_features: NDArray[np.float64]
    """(E, F), divided by their sizes."""
    sets: SetTerms | None
    labels: NDArray[np.int64]
    """(N,) -1 where unknown."""
    loss: NDArray[np.float64]
    """(N,) what a wrong label costs; 0 where it is unknown or given as evidence."""
    observed: NDArray[np.int64] | None
    """(N,) labels that are evidence while learning, -1 elsewhere."""
    loss_of: LossOf
    """What a wrong label costs at nodes of given labels, once the unknown ones are known."""
    n_labels: int
    offset: NDArray[np.float64] | None = None
    """(N, K) scores of the nodes that are not learned."""
