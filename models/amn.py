"""Associative Markov network: nodes and edges scored by learned weights, trained by max margin."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array
from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout, StepLayout
from pgm_places.inference.backends import in_learned_order, learned
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import LabelingProblem, labelled_problems
from pgm_places.models.amn_learning import (
    Learner,
    LearningOptions,
    choose_completed,
    held_out_path,
    learn,
    learn_hidden,
    learning_record,
    resolved_learner,
    weighted,
)
from pgm_places.models.completion import completes
from pgm_places.models.decoders import Decoder
from pgm_places.models.held_out_choice import Candidate, Path
from pgm_places.models.labelled_examples import (
    labelled_parts,
    penalties_of,
)
from pgm_places.models.linear_features import (
    OFFSET,
    PreparedProblems,
    edge_feature_count,
    edge_features,
    edge_sizes,
    node_features,
    node_offset,
    parse_node_features,
)
from pgm_places.models.linear_model import require_edge_features
from pgm_places.models.linear_training import Learned, Selection, TrainedLinearModel, TrainingSet
from pgm_places.options import Positive, Whole
from pgm_places.options.marks import Gt, Lt, MinLen
from pgm_places.solvers.margin_solution import OnStep
from pgm_places.solvers.max_margin import MaxMarginProblem
from pgm_places.solvers.max_margin_qp import QPSolver
from pgm_places.solvers.max_oracle import PottsMarginProblem

# Candidates of C="auto", and its value if nothing can be held out.
AUTO_PENALTIES = (10.0, 100.0, 1000.0)
PENALTY = 100.0

# The candidates and the value with an offset.
OFFSET_PENALTIES = (0.01, 1.0, 10.0, 100.0)
OFFSET_PENALTY = 10.0

parse_parts = partial(parse_node_features, with_offset=True)

_REMEDIES = "take a smaller C{}, or method 'crf' where neighbours do not only agree"


@dataclass(frozen=True, eq=False)
class AssociativeMarkovNetwork(TrainedLinearModel):
    """Joint labelling by learned node scores and learned rewards for agreeing neighbours.

    A labelling scores ``sum_i w_n[:, y_i] . x_i + sum_ij [y_i = y_j] w_e[:, y_i] . x_ij`` with
    ``w_e >= 0``. The weights maximise the margin between the true labelling and every other one;
    the required margin grows with the number of wrong nodes (paper section 6.3; Taskar,
    Chatalbashev and Koller, ICML 2004).

    Parameters
    ----------
    learner : {"auto", "cutting-plane", "qp"}
        ``qp``: the compact QP in cvxpy, exact for the relaxed objective (some thousand nodes).
        ``cutting-plane``: cuts from a graph cut with a small QP over them (any size). ``auto`` is
        the QP if it needs about a second or two; ``summary`` has the choice and its reason.
    inference : str
        Any decoder of :mod:`pgm_places.models.decoding`: ``graph-cut``, ``lp``, ``trw-s``, ...
    C : float, "auto" or tuple of float
        The price of the mean hinge against the size of the weights; it means the same for maps of
        any size. Several values, or ``auto`` for 10, 100, 1000, are compared by the mean of
        accuracy and balanced accuracy on held-out maps, or on held-out blocks of a single one.
        With an offset ``auto`` chooses among 0.01, which hardly changes the unary's labels, 1 and
        10, if no less accurate than the unary alone on held-out parts, and 100, if better by a
        point. It is 100 if labels are completed.
    node_features : str
        Parts joined by ``+``. ``offset`` adds the unary's log-probabilities, unscaled, to the
        learned scores, which then correct them. ``auto`` is ``logz`` and ``raw`` as far as the
        problem has them, on maps and drives with the offset if C is ``auto``, too; ``raw`` is
        used in addition to ``logz`` only if it labels held-out parts better by a point.
    edge_features : tuple of str
        Names, of which ``auto`` is ``constant``, ``raw-difference`` where the problem has node
        features, and ``given`` where it has edge features.
    edge_scale : float
        Factor of the edge features before learning: the larger, the less edge weights are
        regularised in comparison with node weights.
    unlabelled : {"auto", "hidden", "dropped"}
        Nodes without a label: completed by the model, alternating with learning, or omitted with
        their edges. ``auto`` completes them if most links of labelled nodes lead to them; omitting
        them would then make links far too strong. ``completion_objectives`` has the objective of
        each round.
    solver : {"osqp", "clarabel"}
        Solver of the compact QP; if it fails, the other one is tried.
    max_cuts : int
        Limit of the cuts in learning.
    certify_learning : bool
        Whether the learned objective is bounded by TRW-S on the loss-augmented training problem.
        The cutting plane then also adds the labellings that its graph cut missed.
    certified_tolerance : float
        The relative gap of that objective to the lower bound that the cutting plane tries to reach.

    Further options are those of :class:`~pgm_places.models.linear_model.LinearModel`: ``loss``,
    ``class_weight``, ``scale``, ``warm_start`` and others. So are, after ``fit``, ``summary``
    (status of learning, C as ``penalty``, objective, lower bound, held-out accuracies) and
    ``learned_names``, the K labels in the order of the weights.

    Attributes
    ----------
    node_weights : (D + 1, K) float
        Learned weights of the scaled node features, and of a constant; None before ``fit``.
    edge_weights : (F, K) float
        Learned rewards of agreement, at least 0, by edge feature and label.

    Examples
    --------
    >>> from pgm_places.graph.label_graph import LabelGraph
    >>> graph = LabelGraph.from_trajectory(np.arange(12.0).reshape(6, 2))
    >>> truth = np.array([0, 0, 0, 1, 1, 1])
    >>> z = np.array([[0.8, 0.2], [0.4, 0.6], [0.8, 0.2], [0.2, 0.8], [0.4, 0.6], [0.1, 0.9]])
    >>> problem = LabelingProblem(graph, ["room", "corridor"], unary=np.log(z))
    >>> network = AssociativeMarkovNetwork(C=100.0).fit([problem], [truth])
    >>> network.infer(problem).labels.tolist()
    [0, 0, 0, 1, 1, 1]
    >>> network.summary["status"]
    'within_tolerance'
    """

    _has_offset: ClassVar[bool] = True
    _edge_array: ClassVar[str] = "edge_weights"

    learner: Learner = "auto"
    inference: Decoder = "graph-cut"
    C: Positive | Literal["auto"] | Annotated[tuple[Positive, ...], MinLen(1)] = "auto"
    edge_scale: Positive = 2.0
    unlabelled: Literal["auto", "hidden", "dropped"] = "auto"
    solver: QPSolver = "osqp"
    max_cuts: Whole = 500
    certify_learning: bool = True
    certified_tolerance: Annotated[float, Gt(0), Lt(1)] = 5e-3
    edge_weights: NDArray[np.float64] | None = learned()
    completion_objectives: NDArray[np.float64] | None = learned()

    # ------------------------------------------------------------------ learning

    def _completes(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        weights: Sequence[NDArray[np.float64]] | None,
    ) -> bool:
        if not completes(self.unlabelled, labelled_problems(problems, labelings)):
            return False
        if weights is not None:
            raise InputError(
                "sample_weight cannot be combined with the completion of missing labels, which "
                "sets the weights of completed nodes; use unlabelled='dropped'"
            )
        if OFFSET in parse_parts(self.node_features):
            raise InputError(
                "an offset cannot be combined with the completion of missing labels; remove offset "
                "from node_features, or use unlabelled='dropped'"
            )
        if self._is_warm:
            raise InputError(
                "warm_start cannot be combined with the completion of missing labels, which begins "
                "with labels instead of weights; use unlabelled='dropped' or warm_start=False"
            )
        return True

    def _selection(self, data: TrainingSet) -> Selection:
        hidden = data.completes
        choices = self._node_choices([problem for problem, _ in data.examples])
        if self._is_warm and self.C == "auto" and self.learning is not None:
            return _selected(choices[0], float(self.summary["penalty"]))
        n, of_offset = self.n_validation_blocks, OFFSET in parse_parts(choices[0])
        auto = OFFSET_PENALTIES if of_offset else AUTO_PENALTIES
        middle = OFFSET_PENALTY if of_offset else PENALTY
        penalties = penalties_of(self.C, auto)
        usual = middle if self.C == "auto" else penalties[0]
        if hidden and (self.C == "auto" or len(penalties) == 1):
            return _selected(self._node_parts, usual)
        if len(choices) * len(penalties) == 1:
            return _selected(choices[0], usual)
        ready, task = data.prepared(self._node_parts if hidden else choices[0])
        if hidden:
            options = self._learner_options(task, hidden)[0]
            parts = data.hidden_parts(n)
            if task.observed is not None:
                parts[task.observed >= 0] = -1
            hiding = choose_completed(task, ready.labels, parts, penalties, ready.loss_of, options)
            return _selected(self._node_parts, *hiding)
        alone = None if task.offset is None else task.offset.argmax(axis=1)
        kinds = choices, ("cutting-plane",)
        choice = self._held_out_choice(data, kinds, penalties, middle, alone)
        if choice.weights is None:  # nothing could be held out
            return _selected(choices[-1], usual, choice.table)
        return _selected(choice.best.node_features, choice.best.penalty, choice.table)

    def _path(self, task: MaxMarginProblem, part: NDArray[np.bool_], learner: str) -> Path:  # noqa: ARG002
        return held_out_path(task, part, self._learner_options(task, hidden=False)[0])

    def _learn(self, data: TrainingSet, chosen: Selection, on_iteration: OnStep | None) -> Learned:
        ready, task = data.prepared(chosen.candidate.node_features)
        task = replace(task, penalty=chosen.candidate.penalty)
        options, reason = self._learner_options(task, data.completes)
        start, objectives = time.perf_counter(), None
        if data.completes:
            completed = learn_hidden(
                task, ready.labels, ready.loss_of, options, on_iteration=on_iteration
            )
            solution, objectives = completed.solution, completed.objectives
        else:
            solution = learn(task, options, start=chosen.start, on_iteration=on_iteration)
        seconds = time.perf_counter() - start
        record = learning_record(task, solution, len(data.examples), seconds, options, reason)
        other = "" if options.learner == "qp" else ", learner='qp'"
        arrays = {"completion_objectives": objectives}
        return Learned(solution, record, _REMEDIES.format(other), arrays)

    def learning_problem(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> MaxMarginProblem:
        """The max-margin problem of all maps, as :meth:`fit` passes it to the learner.

        C is the first of several, 100 for ``auto``; features are not chosen.
        """
        penalty = PENALTY if self.C == "auto" else penalties_of(self.C, AUTO_PENALTIES)[0]
        ready = self._prepared(labelled_parts(problems, labelings), self._node_parts)
        return replace(self._task(ready, None), penalty=penalty)

    def _task(
        self, ready: PreparedProblems, counts: NDArray[np.float64] | None
    ) -> MaxMarginProblem:
        """All maps as one weighted problem; unknown labels are 0, with a loss of 0."""
        kind = MaxMarginProblem if ready.offset is None else PottsMarginProblem
        task = kind(
            ready.nodes,
            ready.edges.astype(np.int32),
            ready.edge_features,
            np.maximum(ready.labels, 0),
            ready.n_labels,
            ready.loss,
            PENALTY,
            ready.sets,
            ready.observed,
            self._costs(ready.n_labels),
            ready.offset,
        )
        return task if counts is None else weighted(task, counts)

    def _terms(self, task: MaxMarginProblem) -> MaxMarginProblem:
        return task

    def _weights_per_edge(self, ready: PreparedProblems) -> int:
        return ready.n_labels if ready.offset is None else 1

    def _node_columns(self, problem: LabelingProblem, parts: str) -> NDArray[np.float64]:
        return node_features(problem, parse_parts(parts))

    def _node_choices(self, problems: Sequence[LabelingProblem]) -> tuple[str, ...]:
        choices = super()._node_choices(problems)
        is_open = self.node_features == self.C == "auto" and not self._is_warm
        layouts = [each.graph.layout for each in problems]
        is_mapped = all(
            one.source is not None if isinstance(one, GridLayout) else isinstance(one, StepLayout)
            for one in layouts
        )
        if not (is_open and is_mapped) or any(each.unary is None for each in problems):
            return choices
        return tuple(f"offset+{name}" for name in (choices if len(choices) > 1 else ("logz",)))

    def _edge_columns(self, problem: LabelingProblem) -> NDArray[np.float64]:
        features = edge_features(problem, self.edge_features)
        if features.min(initial=0.0) < 0:
            raise InputError(
                "an associative network needs edge_features of at least 0, got "
                f"{features.min():g}; shift signed features, split each into a positive and a "
                "negative column, or use method 'crf', whose tables may have any sign"
            )
        return self.edge_scale * features

    def _edge_sizes(self, problems: Sequence[LabelingProblem]) -> NDArray[np.float64]:
        sizes = edge_sizes(problems, self.edge_features)
        return np.ones_like(sizes) if self.scale == "none" else sizes

    def _learner_options(self, task: MaxMarginProblem, hidden: bool) -> tuple[LearningOptions, str]:
        """The options of learning, and the reason for the learner."""
        learner, reason = resolved_learner(task, self.learner, needs_cuts=hidden or self._is_warm)
        options = LearningOptions(
            learner,
            self.learning_tolerance,
            self.max_cuts,
            self.time_limit_s,
            self.certified_tolerance if self.certify_learning else None,
            self.solver,
        )
        return options, reason

    # ------------------------------------------------------------------ use

    @in_learned_order
    def potentials(self, problem: LabelingProblem) -> Potentials:
        """The log-potentials of a problem's nodes and edges by the learned weights.

        Rewards of cliques are in :meth:`clique_rewards`.
        """
        node_weights, edge_weights = self._learned("node_weights", "edge_weights")
        self._require_labels(problem)
        require_edge_features(edge_feature_count(problem, self.edge_features), len(edge_weights))
        nodes = self._scaling().apply(self._node_columns(problem, self._node_parts))
        edges = self._edge_columns(problem)
        scores, offset = nodes @ node_weights, node_offset(problem, parse_parts(self._node_parts))
        unary = problem.with_evidence(scores if offset is None else scores + offset)
        return Potentials(unary, agreement=edges @ edge_weights)

    @in_learned_order
    def infer(self, problem: LabelingProblem) -> Labeling:
        """The labels of largest score that the chosen decoder finds, with that score.

        ``info["learning"]`` has the record of learning; ``bound`` is set if the decoder proves one
        or ``certify`` is set.
        """
        return self._decoded(problem, self.potentials(problem), self.inference)

    def _check_learned(self) -> None:
        super()._check_learned()
        node_weights, edge_weights = self._learned("node_weights", "edge_weights")
        finite_array("edge_weights", edge_weights, ("F", node_weights.shape[1]))
        if edge_weights.size and edge_weights.min() < 0:
            raise InputError("edge_weights must be at least 0")


def _selected(
    node_parts: str, penalty: float, search: NDArray[np.float64] | None = None
) -> Selection:
    """A choice of node features and C; the learner follows from the problem's size."""
    return Selection(Candidate(node_parts, "auto", penalty), "", search)
