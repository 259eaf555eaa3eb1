"""Loss-augmented decoding for max-margin learning: oracles and certificates; learning of tables."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import Adjacency, adjacency
from pgm_places.solvers.forest import forest_maximum
from pgm_places.solvers.graph_cut import MoveSpace, alpha_expansion
from pgm_places.solvers.local_search import improved_modes
from pgm_places.solvers.max_margin import MarginProblem, MaxMarginProblem, Oracle, hinge, objective
from pgm_places.solvers.pairwise import PairwiseModel, pairwise_model, total_score
from pgm_places.solvers.table_field import FieldTables, TableField
from pgm_places.solvers.trws import RepeatedDecoding, trws

# Passes of TRW-S for a certificate; more hardly improve it.
MAX_PASSES = 1_000


def problem_oracle(problem: MaxMarginProblem, *, from_last: bool = False) -> Oracle:
    """:func:`graph_cut_oracle` of a problem's graph, including the nodes of its sets."""
    oracle = graph_cut_oracle(problem.n_whole, problem.whole_edges, from_last=from_last)
    return lambda unary, agreement: oracle(unary, agreement)[: problem.n_nodes]


def graph_cut_oracle(n_nodes: int, edges: NDArray[np.int32], *, from_last: bool = False) -> Oracle:
    """Alpha-expansion on one graph: exact for two labels, near the best for more; not thread-safe.

    ``from_last`` starts from the last call's labels: fewer moves while the weights change little,
    but a labelling missed by one call is likely missed by the next.
    """
    around = adjacency(n_nodes, edges)
    space = MoveSpace(around)
    last: NDArray[np.int64] | None = None

    def best(unary: NDArray[np.float64], agreement: NDArray[np.float64]) -> NDArray[np.int64]:
        nonlocal last
        model = pairwise_model(unary, around, agreement)
        labels = alpha_expansion(model, initial=last, space=space).labels
        if from_last:
            last = labels
        return labels

    return best


@dataclass(frozen=True, eq=False)
class Certificate:
    """A rigorous upper bound of f at some weights."""

    objective: float
    """Upper bound of f(w), and of the objective with the LP relaxation as far as the bound has
    converged."""
    labels: NDArray[np.int64]
    """(N,) the best labelling found of the loss-augmented problem: a new cut if the quick oracle
    missed it."""


def certify_weights(
    problem: MaxMarginProblem,
    weights: NDArray[np.float64],
    *,
    accuracy: float = 1e-3,
    max_iterations: int = MAX_PASSES,
) -> Certificate:
    """The objective at ``weights`` (n_weights,), with the hinge replaced by its TRW-S upper bound.

    It is no smaller than ``f(weights)``, and minus a lower bound of f's minimum it bounds the
    distance to the optimum. TRW-S (V. Kolmogorov, PAMI 2006) runs on the loss-augmented potentials
    until a tighter bound could change the objective by at most the share ``accuracy``.
    """
    unary, agreement = problem.augmented_potentials(weights)
    model = pairwise_model(unary, problem.whole_edges, agreement)
    quick = alpha_expansion(model)
    certificate = certify(
        problem, weights, model, quick.labels, accuracy=accuracy, max_iterations=max_iterations
    )
    # moves from there reach further than from the best unaries, where the quick oracle starts
    labels = alpha_expansion(model, initial=certificate.labels).labels
    return replace(certificate, labels=labels[: problem.n_nodes])


def certify(
    problem: MarginProblem,
    weights: NDArray[np.float64],
    model: PairwiseModel,
    quick: NDArray[np.integer],
    *,
    accuracy: float = 1e-3,
    max_iterations: int = MAX_PASSES,
) -> Certificate:
    """The bound from the augmented potentials; TRW-S starts with the labels of a quick oracle."""
    known = objective(problem, weights, hinge(problem, weights, total_score(model, quick)))
    slack = accuracy * known * problem.n_nodes / problem.penalty
    decoded = trws(
        model,
        initial=quick,
        max_iterations=max_iterations,
        tolerance=slack / model.size if model.size > 0 else 0.0,
    )
    bounded = hinge(problem, weights, decoded.bound)
    return Certificate(objective(problem, weights, bounded), decoded.labels)


@dataclass(frozen=True, eq=False)
class PottsMarginProblem(MaxMarginProblem):
    """A :class:`~pgm_places.solvers.max_margin.MaxMarginProblem` with edge weights (F,).

    With weights per label, a label with larger edge rewards gains at every node inside a region.
    Next to an offset of likely labels, this relabels entire regions; common weights only change
    borders.
    """

    @property
    def n_pair_weights(self) -> int:
        """D K + F: where the clique weights begin in the flat weight vector."""
        return self.n_free + self.edge_features.shape[1]

    def split(
        self, weights: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Node weights (D, K) of a flat weight vector, and edge weights repeated for each label."""
        start, end = self.n_free, self.n_pair_weights
        of_edges = np.repeat(weights[start:end, None], self.n_labels, axis=1)
        return weights[:start].reshape(-1, self.n_labels), of_edges

    def edge_part(self, by_label: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums of edge features by label (F, K) as (F,) sums over all labels."""
        return np.asarray(by_label.sum(axis=1))

    def _less_than_truth(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        return MarginProblem._less_than_truth(self, labels)


# Passes of TRW-S for a cut; a certificate needs more.
ORACLE_PASSES = 40


@dataclass(frozen=True, eq=False)
class TableMarginProblem(MarginProblem):
    """One training problem, or several as blocks."""

    field: TableField
    labels: NDArray[np.int64]
    """(N,) the true label of every node."""
    loss: NDArray[np.float64]
    """(N,) cost of a wrong label at each node; 0 if the label is only assumed."""
    penalty: float
    """C > 0, the price of the mean hinge against the size of the weights."""
    observed: NDArray[np.int64] | None = None
    """(N,) observed labels, -1 elsewhere."""
    costs: NDArray[np.float64] | None = None
    """(K, K) what label ``j`` costs where ``i`` is true, times the node's loss; 1 for all by
    default."""

    def __post_init__(self) -> None:
        self._check_truth(self.field.n_labels)
        if self.loss.max() <= 0:
            raise InputError("loss must be positive at some node")

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
        """Number of weights of any sign: all but the clique weights."""
        return self.field.n_free

    def potentials(self, weights: NDArray[np.float64]) -> FieldTables:
        """Potentials of the field's pairwise graph."""
        return self.field.whole_potentials(weights)

    def features_of(self, labels: NDArray[np.int64]) -> NDArray[np.float64]:
        """The joint features, see :meth:`TableField.features_of`."""
        return self.field.features_of(labels)


def best_labels(
    field: TableField, unary: NDArray[np.float64], tables: NDArray[np.float64], max_passes: int
) -> NDArray[np.int64]:
    """A labelling of the field's pairwise graph of large score: optimal on a forest."""
    if field.is_forest:
        return forest_maximum(pairwise_model(unary, field.around, pairwise=tables)).labels
    if field.sets is None:
        model = pairwise_model(unary, field.around, pairwise=tables)
        return trws(model, max_iterations=max_passes).labels
    return _best_with_sets(field.whole, field.n_nodes, unary, tables, max_passes)


def _best_with_sets(
    graph: Adjacency,
    n_nodes: int,
    unary: NDArray[np.float64],
    tables: NDArray[np.float64],
    max_passes: int,
) -> NDArray[np.int64]:
    """The best labelling by TRW-S (nodes of sets first) and local search, also from constants."""
    n_after = graph.n_nodes - n_nodes
    edges = (graph.edges + n_after) % graph.n_nodes
    turned = pairwise_model(np.roll(unary, n_after, axis=0), edges, pairwise=tables)
    first = trws(turned, max_iterations=max_passes)
    starts = [np.roll(first.labels, -n_after).astype(np.int32)]
    allowed = np.flatnonzero(np.isfinite(unary).all(axis=0))
    starts += [np.full(graph.n_nodes, k, np.int32) for k in allowed]
    model = pairwise_model(unary, graph, pairwise=tables)
    for labels in starts:
        improved_modes(model, labels)
    return max(starts, key=lambda labels: total_score(model, labels)).astype(np.int64)


def table_oracle(field: TableField, *, from_last: bool = False) -> Oracle:
    """A function that finds labellings of large score on a field's pairwise graph.

    ``from_last`` continues from the last call's messages with a few passes and a local search: a
    fifth of the time while the weights change little, but not thread-safe.
    """
    if from_last and not field.is_forest and field.sets is None:
        again = RepeatedDecoding()

        def near(unary: NDArray[np.float64], tables: NDArray[np.float64]) -> NDArray[np.int64]:
            model = pairwise_model(unary, field.around, pairwise=tables)
            labels = again.labels(model)
            improved_modes(model, labels)
            return labels.astype(np.int64)

        return near

    def best(unary: NDArray[np.float64], tables: NDArray[np.float64]) -> NDArray[np.int64]:
        return best_labels(field, unary, tables, ORACLE_PASSES)[: field.n_nodes]

    return best


def certify_tables(problem: TableMarginProblem, weights: NDArray[np.float64]) -> Certificate:
    """:func:`certify_weights` for tables."""
    field = problem.field
    unary, tables = problem.augmented_potentials(weights)
    quick = best_labels(field, unary, tables, ORACLE_PASSES)
    model = pairwise_model(unary, field.whole, pairwise=tables)
    proof = certify(problem, weights, model, quick)
    return replace(proof, labels=proof.labels[: field.n_nodes])
