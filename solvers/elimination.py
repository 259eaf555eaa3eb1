"""Dead-end elimination: removes labels that no optimal labelling contains."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import frozen_copy
from pgm_places._core import eliminate_labels
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model


class _Alive(NamedTuple):
    """The labels that are still possible."""

    labels: NDArray[np.bool_]
    """(N, K)."""
    n_labels: NDArray[np.int32]
    """(N,) number of possible labels of each node."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """A problem without the decided nodes, with the same optimal labellings."""

    model: PairwiseModel
    """The problem on the remaining nodes. Labels that were ruled out are forbidden; potentials with
    decided neighbours are part of the unaries, scores of decided nodes of the offset."""
    nodes: NDArray[np.int64]
    """(M,) the remaining nodes, in order."""
    labels: NDArray[np.int32]
    """(N,) the label of each decided node, the first possible one elsewhere."""

    def lift(self, labels: NDArray[np.integer]) -> NDArray[np.int32]:
        """A labelling (M,) of the remaining nodes extended to all nodes (N,)."""
        full = self.labels.copy()
        full[self.nodes] = labels
        return full


def lifted_duals(
    full: PairwiseModel, reduced: Reduction, duals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(2 E, K) duals of the full problem from duals of the reduced one; the bound is the same.

    An edge with one decided end gives its potential to the open end; eliminated labels are -inf.
    """
    edges, n_labels = full.around.edges, full.n_labels
    if full.agreement is None:
        return duals
    alive = np.zeros(full.unary.shape, np.bool_)
    alive[np.arange(full.n_nodes), reduced.labels] = True
    alive[reduced.nodes] = reduced.model.unary > -np.inf
    is_open = np.zeros(full.n_nodes, np.bool_)
    is_open[reduced.nodes] = True
    lifted = np.zeros((len(edges), 2, n_labels))  # to the second end, then to the first
    lifted[is_open[edges].all(axis=1)] = duals.reshape(-1, 2, n_labels)
    for to, end in ((0, 1), (1, 0)):
        border = np.flatnonzero(is_open[edges[:, end]] & ~is_open[edges[:, 1 - end]])
        label = reduced.labels[edges[border, 1 - end]]
        lifted[border, to, label] = full.agreement[border, label]
        lifted[:, to][~alive[edges[:, end]]] = -np.inf
    return lifted.reshape(-1, n_labels)


def reduce_model(model: PairwiseModel) -> Reduction:
    """The problem without labels that no optimal labelling contains; pairwise tables do not change.

    R. F. Goldstein, "Efficient rotamer elimination applied to protein side-chains and related spin
    glasses" (Biophysical Journal 1994), applied until no label can be eliminated.
    """
    if model.agreement is None:
        first = model.unary.argmax(axis=1).astype(np.int32)
        return Reduction(model, np.arange(model.n_nodes), first)
    alive = np.empty(model.unary.shape, np.bool_)
    n_alive = np.empty(model.n_nodes, np.int32)
    ring, waiting = np.empty(model.n_nodes, np.uint32), np.empty(model.n_nodes, np.bool_)
    eliminate_labels(model.terms, model.around.arcs, _Alive(alive, n_alive), ring, waiting)
    open_nodes = n_alive > 1
    labels = alive.argmax(axis=1).astype(np.int32)
    unary = np.where(alive, model.unary, -np.inf)
    edges = model.around.edges
    offset = model.offset + float(unary[~open_nodes, labels[~open_nodes]].sum())
    open_ends = open_nodes[edges]
    for side in (0, 1):
        border = np.flatnonzero(open_ends[:, side] & ~open_ends[:, 1 - side])
        node, label = edges[border, side], labels[edges[border, 1 - side]]
        np.add.at(unary, (node, label), model.agreement[border, label])
    closed = np.flatnonzero(~open_ends.any(axis=1))
    first, second = labels[edges[closed, 0]], labels[edges[closed, 1]]
    same = closed[first == second]
    offset += float(model.agreement[same, labels[edges[same, 0]]].sum())
    inside = open_ends.all(axis=1)
    new_index = np.cumsum(open_nodes) - 1
    smaller = pairwise_model(
        unary[open_nodes],
        adjacency(int(open_nodes.sum()), new_index[edges[inside]]),
        model.agreement[inside],
    )
    left = PairwiseModel(smaller.around, smaller.unary, smaller.agreement, smaller.tables, offset)
    return Reduction(left, np.flatnonzero(open_nodes), frozen_copy(labels))
