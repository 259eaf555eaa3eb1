"""Training problems concatenated for learners of linear models, with scaled features."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.models.completion import LossOf
from pgm_places.models.feature_scaling import Standardization
from pgm_places.solvers.set_terms import SetTerms


class TermSizes(NamedTuple):
    """Divisors of edge and clique features during learning.

    Learned weights are divided by them afterwards, to apply to unscaled features.
    """

    edges: NDArray[np.float64]
    """(F,)."""
    cliques: NDArray[np.float64]
    """(G,), G = 0 without cliques."""

    def of_weights(self, n_weights: int, n_labels: int, per_edge: int) -> NDArray[np.float64]:
        """(n_weights,) divisors of flat weights: nodes 1, edges ``per_edge`` times, cliques K."""
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
    """(N,) cost of a wrong label; 0 where it is unknown or observed."""
    observed: NDArray[np.int64] | None
    """(N,) observed labels, -1 elsewhere."""
    loss_of: LossOf
    """Labels (n,) -> cost of a wrong label at each node, for completed labels."""
    n_labels: int
    offset: NDArray[np.float64] | None = None
    """(N, K) fixed scores of the nodes."""
