"""Conditional random field: scores of nodes and full tables of label pairs, all learned."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError, LearningWarning
from pgm_places.inference.backends import in_learned_order, learned
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.amn_learning import LearningOptions
from pgm_places.models.crf_learning import (
    FieldLearner,
    LearningTask,
    choose_by_hiding,
    choose_link_scale,
    damped,
    held_out_path,
    learn,
    learners_to_compare,
    needs_damping,
)
from pgm_places.models.decoders import Decoder
from pgm_places.models.held_out_choice import Candidate, Path
from pgm_places.models.labelled_examples import (
    held_out_parts,
    penalties_of,
)
from pgm_places.models.learning_record import REASONS, LearningRecord
from pgm_places.models.linear_features import (
    PreparedProblems,
    edge_features,
    edge_sizes,
    field_features,
    with_auto,
)
from pgm_places.models.linear_model import require_edge_features
from pgm_places.models.linear_training import Learned, Selection, TrainedLinearModel, TrainingSet
from pgm_places.models.observed_labels import without_observed
from pgm_places.options import Positive, Whole
from pgm_places.options.marks import Gt, Lt, MinLen
from pgm_places.solvers.adjacency import adjacency, is_forest
from pgm_places.solvers.margin_solution import OnStep
from pgm_places.solvers.table_field import TableField

# Candidates of C="auto", and its value if nothing can be held out.
AUTO_PENALTIES = (1.0, 10.0, 100.0, 1000.0, 10_000.0)
PENALTY = 1000.0

_REMEDIES = "take learner='pseudo-likelihood', which needs no maximum, or C='auto'"

# Edge scale on chains: one table is shared by all steps, but there are many node weights.
CHAIN_SCALE = 2.0


@dataclass(frozen=True, eq=False)
class ConditionalRandomField(TrainedLinearModel):
    """Joint labelling by learned node scores and learned scores of all pairs of labels.

    A labelling scores ``sum_i w_n[:, y_i] . x_i + sum_ij w_t[:, y_i, y_j] . z_ij``. The tables
    ``w_t`` (one for each edge feature) may have any sign, so that labels can repel each other,
    follow each other in one direction, or never meet. If neighbours only tend to agree,
    :class:`~pgm_places.models.amn.AssociativeMarkovNetwork` needs fewer weights.

    Parameters
    ----------
    learner : {"auto", "likelihood", "pseudo-likelihood", "piecewise", "max-margin"}
        The objective of the weights: the likelihood of the labels, exact on chains, trees and
        forests; on any graph the likelihood of each node given its neighbours
        (``pseudo-likelihood``) or of each edge by itself (``piecewise``); or the margin between the
        true labelling and every other one. ``auto`` is ``likelihood`` if no training graph has a
        cycle or cliques; else ``max-margin`` or ``pseudo-likelihood``, whichever labels held-out
        parts better. ``summary`` has the choice and its reason.
    inference : {"auto"} or str
        The name of any decoder (docs/inference.md). ``auto`` is exact on graphs without
        cycles: the most probable label of each node after learning by likelihood (``sum-product``)
        and the best labelling after ``max-margin`` (``max-product``); elsewhere ``trw-s``.
    C : float, "auto" or tuple of float
        The price of the mean loss (minus the log-likelihood, or the hinge) of a node against the
        size of the weights. Several, or ``auto`` for 1, 10, ..., 10000, are compared by the mean of
        accuracy and balanced accuracy on held-out problems, or blocks of a single one, until the
        mean falls. ``auto`` is 1000 if labels are completed or links are damped.
    unlabelled : {"hidden", "dropped"}
        Nodes without a label: ``hidden`` sums over their labels (likelihoods) or completes them
        (max margin), so that they inform learning, which then ends at a local optimum; ``dropped``
        omits them with their edges.
    tables_tell : {"auto", "order", "pair"}
        Whether a table distinguishes the first node of an edge (the one of lower index) from the
        second (``order``) or is symmetric (``pair``). ``auto`` is ``order`` if all training graphs
        are chains.
    node_features : str
        Parts joined by ``+``. ``auto`` is ``logz`` if the problem has a unary, else ``raw``: given
        the classifier's scores its features add little, and their weights fit noise. If several C
        are compared, ``raw`` is added if it labels held-out parts better by a point.
    edge_features : tuple of str
        Names, of which ``auto`` is ``constant``, and ``given`` where the problem has edge
        features.
    edge_scale : float or "auto"
        Factor of the edge features during learning: the larger, the less tables are regularised in
        comparison with node weights. The learned ``tables`` are for unscaled features. ``auto`` is
        2 for likelihoods if all training graphs are chains, else 1.
    max_steps : int
        Limit of the steps (or cuts) of learning.
    certified_tolerance : float, optional
        Target of the relative gap certified by TRW-S, for max margin on graphs with cycles.

    Further options are those of :class:`~pgm_places.models.linear_model.LinearModel`: ``loss``,
    ``class_weight``, ``scale``, ``warm_start`` and others. So are, after ``fit``, ``summary``
    (status of learning, C as ``penalty``, objective, lower bound, held-out accuracies) and
    ``learned_names``, the K labels in the order of the weights.

    Attributes
    ----------
    node_weights : (D + 1, K) float
        Learned weights of the scaled node features, and of a constant; None before ``fit``.
    tables : (F, K, K) float
        Learned scores of pairs of labels, by edge feature, first and second node.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> truth = np.arange(60) % 3  # one after the other, in a ring
    >>> looks = np.eye(3)[truth] + np.random.default_rng(0).normal(size=(60, 3))
    >>> chain = LabelGraph.from_lattice((60,))
    >>> problem = LabelingProblem(chain, ["a", "b", "c"], node_features=looks)
    >>> field = ConditionalRandomField().fit([problem], [truth])
    >>> field.tables[0].argmax(axis=1).tolist()
    [1, 2, 0]
    >>> float(np.mean(field.infer(problem).labels == truth))
    1.0
    """

    _edge_array: ClassVar[str] = "tables"

    learner: Literal["auto", FieldLearner] = "auto"
    inference: Literal["auto"] | Decoder = "auto"
    C: Positive | Literal["auto"] | Annotated[tuple[Positive, ...], MinLen(1)] = "auto"
    unlabelled: Literal["hidden", "dropped"] = "hidden"
    tables_tell: Literal["auto", "order", "pair"] = "auto"
    edge_scale: Positive | Literal["auto"] = "auto"
    max_steps: Whole = 500
    certified_tolerance: Annotated[float, Gt(0), Lt(1)] | None = 5e-3
    tables: NDArray[np.float64] | None = learned()
    by_margin: NDArray[np.bool_] | None = learned()
    link_scales: NDArray[np.float64] | None = learned()

    # ------------------------------------------------------------------ learning

    def _targets(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> tuple[Sequence[LabelingProblem], Sequence[NDArray[np.int64]]]:
        if self.learner == "pseudo-likelihood":
            return without_observed(problems, labelings)
        return problems, labelings

    def _completes(self, *_: object) -> bool:
        return self.unlabelled == "hidden"

    def _learn(self, data: TrainingSet, chosen: Selection, on_iteration: OnStep | None) -> Learned:
        node_parts, learner, penalty = chosen.candidate
        _, task = data.prepared(node_parts)
        options, begin = self._options(learner), time.perf_counter()
        solution = learn(task, penalty, options, start=chosen.start, on_iteration=on_iteration)
        reached, link_scales = solution, None
        if needs_damping(task, learner):
            parts = self._parts_to_hold_out(data)
            share, link_scales = choose_link_scale(task, solution.weights, parts, penalty, options)
            [weights] = damped(task, solution.weights, penalty, [share])
            solution = replace(solution, weights=weights)
            if not share:
                _warn_of_links(learner)
        record = LearningRecord(
            status=reached.status,
            penalty=penalty,
            objective=reached.objective,
            lower_bound=reached.lower_bound,
            certified_objective=reached.certified,
            iterations=reached.iterations,
            seconds=time.perf_counter() - begin,
            certificate_seconds=0.0,
            n_nodes=task.field.n_nodes,
            n_edges=task.field.around.n_edges,
            n_maps=len(data.examples),
            learner=learner,
            reason=chosen.reason,
        )
        arrays = {"by_margin": np.array([learner == "max-margin"]), "link_scales": link_scales}
        return Learned(solution, record, _REMEDIES, arrays)

    def _selection(self, data: TrainingSet) -> Selection:
        choices = self._node_choices([problem for problem, _ in data.examples])
        plain = choices[0] if self.node_features == "auto" else self._node_parts
        penalties = penalties_of(self.C, AUTO_PENALTIES)
        task = data.prepared(plain)[1]
        learners, reason = learners_to_compare(self.learner, task)
        if self._is_warm and self.learning is not None:
            before = self.summary
            learner = before["learner"] if before["learner"] in learners else learners[0]
            penalty = before["penalty"] if self.C == "auto" else penalties[0]
            return Selection(Candidate(plain, learner, penalty), reason)
        usual = Candidate(plain, learners[0], PENALTY if self.C == "auto" else penalties[0])
        hides, is_one = bool((task.labels < 0).any()), len(data.examples) == 1
        if self.C == "auto" and (
            (hides and (is_one or not task.field.is_forest)) or needs_damping(task, learners[0])
        ):
            return Selection(usual, reason)
        if hides and is_one and len(penalties) > 1:
            parts = data.hidden_parts(self.n_validation_blocks)
            penalty, table = choose_by_hiding(task, parts, penalties, self._options(learners[0]))
            return Selection(usual._replace(penalty=penalty), reason, table)
        if len(learners) * len(penalties) == 1:
            return Selection(usual, reason)
        kinds = choices if len(penalties) > 1 else (plain,), learners
        choice = self._held_out_choice(data, kinds, penalties, PENALTY)
        if choice.weights is None:
            return Selection(usual, REASONS[6] if len(learners) > 1 else reason, choice.table)
        return Selection(choice.best, reason, choice.table, None if hides else choice.weights)

    def _path(self, task: LearningTask, part: NDArray[np.bool_], learner: str) -> Path:
        return held_out_path(task, part, self._options(learner))

    def _parts_to_hold_out(self, data: TrainingSet) -> NDArray[np.int64]:
        if any((truth < 0).any() for _, truth in data.examples):
            return data.hidden_parts(self.n_validation_blocks)
        return held_out_parts(data.examples, self.n_validation_blocks)

    def _task(self, ready: PreparedProblems, counts: NDArray[np.float64] | None) -> LearningTask:
        field = TableField(
            ready.nodes,
            adjacency(len(ready.labels), ready.edges),
            ready.edge_features,
            ready.n_labels,
            not ready.are_chains if self.tables_tell == "auto" else self.tables_tell == "pair",
            ready.sets,
        )
        costs = self._costs(ready.n_labels)
        task = LearningTask(
            field, ready.labels, ready.loss, ready.loss_of, observed=ready.observed, costs=costs
        )
        return task if counts is None else task.weighing(counts)

    def _terms(self, task: LearningTask) -> TableField:
        return task.field

    def _weights_per_edge(self, ready: PreparedProblems) -> int:
        return ready.n_labels**2

    def _node_columns(self, problem: LabelingProblem, parts: str) -> NDArray[np.float64]:
        return field_features(problem, parts)

    def _edge_columns(self, problem: LabelingProblem) -> NDArray[np.float64]:
        return edge_features(problem, self.edge_names(problem))

    def _edge_sizes(self, problems: Sequence[LabelingProblem]) -> NDArray[np.float64]:
        sizes = edge_sizes(problems, self.edge_names(problems[0]))
        if self.scale == "none":
            sizes = np.ones_like(sizes)
        chains = all(problem.graph.is_chain and problem.cliques is None for problem in problems)
        auto = CHAIN_SCALE if chains and self.learner != "max-margin" else 1.0
        return sizes / (auto if self.edge_scale == "auto" else self.edge_scale)

    def edge_names(self, problem: LabelingProblem) -> tuple[str, ...]:
        """The edge features of a problem, with ``auto`` resolved."""
        there = {"constant": True, "given": problem.edge_features is not None}
        return tuple(with_auto(self.edge_features, there))

    def _options(self, learner: str) -> LearningOptions:
        return LearningOptions(
            learner,
            self.learning_tolerance,
            self.max_steps,
            self.time_limit_s,
            self.certified_tolerance,
        )

    # ------------------------------------------------------------------ use

    @in_learned_order
    def potentials(self, problem: LabelingProblem) -> Potentials:
        """The log-potentials of a problem's nodes and edges by the learned weights.

        Rewards of cliques are in :meth:`clique_rewards`.
        """
        node_weights, tables = self._learned("node_weights", "tables")
        self._require_labels(problem)
        nodes = self._scaling().apply(self._node_columns(problem, self._node_parts))
        edges = self._edge_columns(problem)
        require_edge_features(edges.shape[1], len(tables))
        around = adjacency(problem.graph.n_nodes, problem.graph.edges)
        field = TableField(nodes, around, edges, problem.n_labels)
        learned = field.potentials(np.concatenate([node_weights.ravel(), tables.ravel()]))
        return Potentials(problem.with_evidence(learned.unary), pairwise=learned.tables)

    @in_learned_order
    def infer(self, problem: LabelingProblem) -> Labeling:
        """The labels that the chosen decoder finds, with their score.

        ``info["learning"]`` has the record of learning; ``bound`` is set if the decoder proves one
        or ``certify`` is set.
        """
        return self._decoded(problem, self.potentials(problem), self.decoder_for(problem))

    def decoder_for(self, problem: LabelingProblem) -> Decoder:
        """The decoder for a problem, with ``auto`` resolved."""
        if self.inference != "auto":
            return self.inference
        if problem.cliques is not None or not is_forest(
            adjacency(problem.graph.n_nodes, problem.graph.edges)
        ):
            return "trw-s"
        [by_margin] = self._learned("by_margin")
        return "max-product" if by_margin[0] else "sum-product"

    def _check_learned(self) -> None:
        super()._check_learned()
        node_weights, tables, by_margin = self._learned("node_weights", "tables", "by_margin")
        n_labels = node_weights.shape[1]
        finite_array("tables", tables, ("F", n_labels, n_labels))
        if by_margin.shape != (1,):
            raise InputError("by_margin must hold one value")


def _warn_of_links(learner: str) -> None:
    warnings.warn(
        f"the links learned by {learner} label held-out nodes no better than each node by itself, "
        "and are left out; take learner='max-margin'",
        LearningWarning,
        stacklevel=4,
    )
