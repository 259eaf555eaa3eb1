"""The edges of a graph as a list of node pairs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen, integer_array
from pgm_places.graph._edges import empty_pairs, require_canonical

__all__ = ["EdgeList"]


@dataclass(frozen=True, eq=False)
class EdgeList:
    """Node pairs, and what kind of edge each is.

    Parameters
    ----------
    pairs : (E, 2) int32
        Pairs with ``i < j``, sorted, each once. Where direction matters it is i to j.
    kinds : (E,) int8 or None
        An :class:`~pgm_places.graph.edge_kind.EdgeKind` per edge.

    Raises
    ------
    InputError
        Pairs in another order; :meth:`LabelGraph.from_edges
        <pgm_places.graph.label_graph.LabelGraph.from_edges>` sorts them.
    """

    pairs: NDArray[np.int32]
    kinds: NDArray[np.int8] | None = None

    def __post_init__(self) -> None:
        pairs = integer_array("edges", empty_pairs(self.pairs), ("E", 2), low=0, high=2**31 - 1)
        require_canonical(pairs)
        object.__setattr__(self, "pairs", frozen(pairs.astype(np.int32)))
        if self.kinds is not None:
            kinds = integer_array("edge_kind", self.kinds, (len(pairs),), low=0, high=128)
            object.__setattr__(self, "kinds", frozen(kinds.astype(np.int8)))

    @property
    def n_edges(self) -> int:
        """E, the number of edges."""
        return len(self.pairs)

    def label_pairs(self, labels: NDArray[np.int64], n_labels: int) -> NDArray[np.int64]:
        """(K, K) how many edges have label ``a`` at their first node and ``b`` at their second."""
        key = labels[self.pairs[:, 0]] * n_labels + labels[self.pairs[:, 1]]
        return np.bincount(key, minlength=n_labels**2).reshape(n_labels, n_labels)

    def among(self, keep: NDArray[np.bool_]) -> "EdgeList":
        """The edges whose two nodes are both in the mask (N,), with its nodes renumbered."""
        number = np.cumsum(keep, dtype=np.int32) - 1
        inside = keep[self.pairs].all(axis=1)
        kinds = None if self.kinds is None else self.kinds[inside]
        return EdgeList(number[self.pairs[inside]], kinds)
