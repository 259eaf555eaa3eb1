"""Max-margin learning of full tables of label pairs, for the cutting plane.

The objective is that of :mod:`pgm_places.solvers.max_margin` with the score of a
:class:`~pgm_places.solvers.table_field.TableField`: no weight is bounded but those of cliques,
since nothing else needs to be associative (I. Tsochantaridis et al., "Large margin methods for
structured and interdependent output variables", JMLR 6 (2005)).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, frozen, integer_array
from pgm_places.errors import InputError
from pgm_places.graph.known_labels import keep_known
from pgm_places.solvers.adjacency import Adjacency
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.local_search import improved_modes
from pgm_places.solvers.margin_solution import Cut
from pgm_places.solvers.max_margin import Oracle
from pgm_places.solvers.max_oracle import Augmented, Certificate, certify
from pgm_places.solvers.pairwise import pairwise_model, total_score
from pgm_places.solvers.table_field import FieldTables, TableField
from pgm_places.solvers.trws import trws

# Passes of TRW-S for a cut; the certificate takes more.
ORACLE_PASSES = 40


@dataclass(frozen=True, eq=False)
class TableMarginProblem:
    """One training problem, or several side by side.

    Parameters
    ----------
    field : TableField
    labels : (N,) int
        The true label of every node.
    loss : (N,) float
        What a wrong label costs at each node; 0 where the label is only assumed.
    penalty : float
        C > 0, the price of the mean hinge against the size of the weights.
    told : (N,) int, optional
        Labels that are known to every labelling, -1 elsewhere.
    """

    field: TableField
    labels: NDArray[np.int64]
    loss: NDArray[np.float64]
    penalty: float
    told: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        n, k = self.field.n_nodes, self.field.n_labels
        labels = integer_array("labels", self.labels, (n,), low=0, high=k)
        loss = finite_array("loss", self.loss, (n,))
        if loss.min() < 0 or loss.max() <= 0:
            raise InputError("loss must be at least 0 at every node, and positive at some")
        if not (np.isfinite(self.penalty) and self.penalty > 0):
            raise InputError(f"penalty (C) must be a positive number, got {self.penalty}")
        object.__setattr__(self, "labels", frozen(labels))
        object.__setattr__(self, "loss", frozen(loss))

    @property
    def n_nodes(self) -> int:
        """N."""
        return self.field.n_nodes

    @property
    def n_weights(self) -> int:
        """Length of the flat weight vector."""
        return self.field.n_weights

    @property
    def n_free(self) -> int:
        """All weights may have any sign but those of cliques."""
        return self.field.n_free

    @cached_property
    def truth_features(self) -> NDArray[np.float64]:
        """The joint features of the true labelling."""
        return frozen(self.field.features_of(self.labels))

    def augmented_potentials(self, weights: NDArray[np.float64]) -> FieldTables:
        """The potentials of score plus loss: l_i is added to every wrong label of node i.

        They are those of the field's whole graph.
        """
        unary, tables = self.field.whole_potentials(weights)
        unary[: self.n_nodes] += self.loss[:, None]
        unary[np.arange(self.n_nodes), self.labels] -= self.loss
        return FieldTables(keep_known(unary, self.told), tables)

    def cut_of(self, labels: NDArray[np.int64]) -> Cut:
        """The plane that a labelling gives: its loss and its joint features against the truth's."""
        wrong = float(self.loss[labels != self.labels].sum())
        difference = self.truth_features - self.field.features_of(labels)
        return Cut(difference / self.n_nodes, wrong / self.n_nodes)


def best_labels(
    field: TableField, unary: NDArray[np.float64], tables: NDArray[np.float64], max_passes: int
) -> NDArray[np.int64]:
    """A labelling of large score: the best on a forest, elsewhere the best that is found.

    It is one of the field's whole graph, whose potentials are given.
    """
    if field.is_forest:
        return forest_maximum(unary, field.around, pairwise=tables).labels
    if field.sets is None:
        return trws(unary, field.around, pairwise=tables, max_iterations=max_passes).labels
    return _best_with_sets(field.whole, field.n_nodes, unary, tables, max_passes)


def _best_with_sets(
    whole: Adjacency,
    n_nodes: int,
    unary: NDArray[np.float64],
    tables: NDArray[np.float64],
    max_passes: int,
) -> NDArray[np.int64]:
    """The best that TRW-S and a local search find, from its labels and from one label for all.

    TRW-S labels each node beside those before it; with the nodes of sets first, members follow
    their sets.
    """
    n_after = whole.n_nodes - n_nodes
    edges = (whole.edges + n_after) % whole.n_nodes
    first = trws(np.roll(unary, n_after, axis=0), edges, pairwise=tables, max_iterations=max_passes)
    starts = [np.roll(first.labels, -n_after).astype(np.int32)]
    allowed = np.flatnonzero(np.isfinite(unary).all(axis=0))
    starts += [np.full(whole.n_nodes, k, np.int32) for k in allowed]
    model = pairwise_model(unary, whole, pairwise=tables)
    for labels in starts:
        improved_modes(model, labels)
    return max(starts, key=lambda labels: total_score(model, labels)).astype(np.int64)


def table_oracle(field: TableField) -> Oracle:
    """What finds labellings of large score for given potentials of a field's whole graph."""

    def best(unary: NDArray[np.float64], tables: NDArray[np.float64]) -> NDArray[np.int64]:
        return best_labels(field, unary, tables, ORACLE_PASSES)[: field.n_nodes]

    return best


def certify_tables(
    problem: TableMarginProblem, weights: NDArray[np.float64], *, accuracy: float = 1e-3
) -> Certificate:
    """The objective at ``weights``, with the hinge replaced by its TRW-S upper bound.

    As :func:`~pgm_places.solvers.max_oracle.certify_weights`, for tables.
    """
    field = problem.field
    unary, tables = problem.augmented_potentials(weights)
    quick = best_labels(field, unary, tables, ORACLE_PASSES)
    augmented = Augmented(field.whole, unary, pairwise=tables)
    proof = certify(problem, weights, augmented, quick, accuracy=accuracy)
    return replace(proof, labels=proof.labels[: field.n_nodes])
