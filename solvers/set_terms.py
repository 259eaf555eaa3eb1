"""What sets of nodes that want one label bring to max-margin learning: features, linear weights.

With features z_c (G,) and weights w_s (G, K) >= 0, both at least 0, a set c earns::

    max_k (w_s[:, k] . z_c) max(0, n - d_k / q),

which is linear in the weights up to q = 1/2, since only one label can then earn anything.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.solvers.set_nodes import SetNodes

__all__ = ["SetTerms"]

MOST_DISSENT = 0.5
"""Beyond, two labels of a set may earn something, and the larger is no linear function."""


@dataclass(frozen=True, eq=False)
class SetTerms:
    """The sets of a learning problem.

    Parameters
    ----------
    nodes : SetNodes
        The nodes and links that stand for them.
    features : (C, G) float
        At least 0.
    """

    nodes: SetNodes
    features: NDArray[np.float64]

    def __post_init__(self) -> None:
        features = finite_array("clique_features", self.features, (self.nodes.n_sets, "G"))
        if features.min(initial=0.0) < 0:
            raise InputError(f"clique_features must be at least 0, got {features.min():g}")
        if self.nodes.dissent > MOST_DISSENT:
            raise InputError(
                f"weights of sets are learned up to a dissent of {MOST_DISSENT}, got "
                f"{self.nodes.dissent}; beyond, more than one label of a set may earn something"
            )
        object.__setattr__(self, "features", frozen(features))

    @classmethod
    def of(
        cls, cliques: Cliques, features: ArrayLike, n_nodes: int, n_labels: int, dissent: float
    ) -> "SetTerms":
        """The terms of sets of a graph of that many nodes."""
        return cls(SetNodes(cliques, n_nodes, n_labels, dissent), np.asarray(features, np.float64))

    def check_fits(self, n_nodes: int, n_labels: int) -> None:
        """Raise InputError unless they are of a problem of that size."""
        if (self.nodes.n_nodes, self.nodes.n_labels) != (n_nodes, n_labels):
            raise InputError(
                f"the sets are of {self.nodes.n_nodes} nodes and {self.nodes.n_labels} labels, the "
                f"problem has {n_nodes} and {n_labels}"
            )

    def joint_features(self, labels: NDArray[np.integer]) -> NDArray[np.float64]:
        """(G K,) the features of the sets by the label for which they earn something, summed."""
        return (self.features.T @ self.nodes.agreed(labels)).ravel()

    def among(self, keep: NDArray[np.bool_]) -> "SetTerms":
        """The terms on the nodes of a mask (N,)."""
        sets = self.nodes
        kept = sets.cliques.sizes_among(keep) > 0
        smaller = SetNodes(sets.cliques.among(keep), int(keep.sum()), sets.n_labels, sets.dissent)
        return SetTerms(smaller, self.features[kept])

    @property
    def joins(self) -> NDArray[np.int32]:
        """Pairs of nodes that join the nodes of each set to its first one."""
        node, of_set = self.nodes.cliques.links.T
        first = self._first[of_set]
        return np.stack([first, node], axis=1)[first != node].astype(np.int32)

    @property
    def _first(self) -> NDArray[np.int64]:
        return self.nodes.cliques.members[self.nodes.cliques.start[:-1]]

    def times(self, shares: NDArray[np.float64]) -> "SetTerms":
        """The terms with features multiplied by the share of a set's nodes, from (N,) of all."""
        return SetTerms(self.nodes, self.features * shares[self._first][:, None])

    @staticmethod
    def beside(parts: Sequence["SetTerms"], starts: ArrayLike) -> "SetTerms | None":
        """The terms of several problems as those of one, whose nodes begin at ``starts``."""
        if not parts:
            return None
        first = parts[0].nodes
        nodes = SetNodes(
            Cliques.beside([part.nodes.cliques for part in parts], starts),
            sum(part.nodes.n_nodes for part in parts),
            first.n_labels,
            first.dissent,
        )
        return SetTerms(nodes, np.concatenate([part.features for part in parts]))
