"""Training of linear structured models, the same for associative networks and random fields."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import stacked_rows
from pgm_places.errors import InputError
from pgm_places.inference.node_weights import weights_of
from pgm_places.inference.problem import LabelingProblem
from pgm_places.models.cliques import clique_sizes, clique_terms, require_like_cliques
from pgm_places.models.completion import LossOf, hidden_parts
from pgm_places.models.feature_scaling import Standardization
from pgm_places.models.held_out_choice import Candidate, Choice, Path, choose, node_choice
from pgm_places.models.label_order import learned_by_frequency
from pgm_places.models.labelled_examples import (
    Example,
    labelled_parts,
    labelled_weights,
    linked_steps,
    node_losses,
    searched_parts,
)
from pgm_places.models.learning_record import LearningRecord, history_array, warn_of_gap
from pgm_places.models.linear_features import (
    OFFSET,
    PreparedProblems,
    TermSizes,
    node_offset,
    parse_node_features,
)
from pgm_places.models.linear_model import LinearModel
from pgm_places.models.observed_labels import (
    mask_observed_losses,
    observed_labels,
    warns_of_few_labels,
    with_observed,
)
from pgm_places.solvers.margin_solution import LearnedWeights, OnStep
from pgm_places.solvers.max_margin import MaxMarginProblem
from pgm_places.solvers.set_terms import SetTerms
from pgm_places.solvers.table_field import TableField


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """The labelled problems, prepared once for each choice of node features."""

    examples: Sequence[Example]
    completes: bool
    """Whether nodes without a label take part."""
    prepared: Callable[[str], tuple[PreparedProblems, Any]]
    """Node features -> all problems as one, and the learning task of the model."""

    def hidden_parts(self, n_parts: int) -> NDArray[np.int64]:
        """(N,) part in which the label of each node is hidden; -1 for unlabelled nodes."""
        return np.concatenate([hidden_parts(p.graph, y, n_parts) for p, y in self.examples])


class Selection(NamedTuple):
    """The options of learning, set or chosen on held-out parts."""

    candidate: Candidate
    reason: str
    """The reason for the learner."""
    search: NDArray[np.float64] | None = None
    """All comparisons."""
    start: NDArray[np.float64] | None = None
    """Flat weights of the scaled features at which learning starts."""


class Learned(NamedTuple):
    """The result of learning, for scaled features."""

    solution: LearnedWeights
    record: LearningRecord
    remedies: str
    """Remedies for a large gap."""
    arrays: Mapping[str, Any]
    """Further learned arrays of the model."""


class TrainedLinearModel(LinearModel):
    """Learning of a linear model: preparation, choice of options, record."""

    C: float | Literal["auto"] | tuple[float, ...]
    _edge_array: ClassVar[str]
    """The learned array with the weights of edges."""

    @warns_of_few_labels
    @learned_by_frequency
    def fit(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        *,
        sample_weight: Sequence[ArrayLike] | None = None,
        on_iteration: OnStep | None = None,
    ) -> Self:
        """A new, fitted model; see ``unlabelled`` for nodes labelled -1.

        Parameters
        ----------
        problems : sequence of LabelingProblem
        labelings : sequence of (N,) int
            The true label index of every node of each problem, -1 where it is unknown. Observed
            labels of a problem (its ``known``) are evidence: learning conditions on them, or, if
            all are observed, on folds of them (:mod:`pgm_places.models.observed_labels`).
        sample_weight : sequence of float or (N,) float, optional
            Weight of each problem, or of each of its nodes: the factor of the cost of a wrong
            label. With max margin a connected part of a graph has the mean weight of its nodes;
            the likelihood needs equal ones.
        on_iteration : callable, optional
            Called with a :class:`~pgm_places.solvers.margin_solution.LearningStep` during learning;
            True stops it with the best weights so far.

        Raises
        ------
        LabelError
            A label without an example in any problem.
        InputError
            Problems and labellings do not match, features are missing, ``likelihood`` is used on a
            graph with a cycle, or a learner does not support the weights.
        """
        weights = None if sample_weight is None else weights_of(sample_weight, problems)
        problems, labelings = self._targets(problems, labelings)
        problems, labelings, weights = with_observed(problems, labelings, weights)
        completes = self._completes(problems, labelings, weights)
        examples = labelled_parts(problems, labelings, with_unlabelled=completes)
        counts = None
        if weights is not None:
            counts = np.concatenate(labelled_weights(weights, labelings, with_unlabelled=completes))

        @cache
        def prepared(parts: str) -> tuple[PreparedProblems, Any]:
            ready = self._prepared(examples, parts)
            return ready, self._task(ready, counts)

        data = TrainingSet(examples, completes, prepared)
        chosen = self._selection(data)
        ready, task = prepared(chosen.candidate.node_features)
        terms, k = self._terms(task), ready.n_labels
        sizes = ready.sizes.of_weights(terms.n_weights, k, self._weights_per_edge(ready))
        if chosen.start is None:
            chosen = chosen._replace(start=self._warm_start(sizes, ready))
        solution, record, remedies, arrays = self._learn(data, chosen, on_iteration)
        warn_of_gap(record, self.scale, remedies, has_offset=ready.offset is not None)
        weights_now = solution.weights / sizes
        node_weights, of_edges = terms.split(weights_now)
        scaling = ready.scaling
        of_model: dict[str, Any] = {self._edge_array: of_edges.copy(), **arrays}
        return replace(
            self,
            node_weights=node_weights.copy(),
            clique_weights=None if terms.sets is None else terms.set_weights(weights_now).copy(),
            feature_columns=scaling.columns,
            feature_mean=scaling.mean,
            feature_scale=scaling.scale,
            feature_clip=np.array([scaling.clip]),
            n_features=np.array([scaling.n_columns], np.int64),
            learning=record.to_array(),
            learning_history=history_array(solution.history),
            penalty_search=chosen.search,
            node_choice=np.array([node_choice(chosen.candidate.node_features)], np.int64),
            **of_model,
        )

    def _targets(
        self, problems: Sequence[LabelingProblem], labelings: Sequence[NDArray[np.int64]]
    ) -> tuple[Sequence[LabelingProblem], Sequence[NDArray[np.int64]]]:
        """Problems and labellings, with observed labels as targets where the learner needs it."""
        return problems, labelings

    @abstractmethod
    def _completes(
        self,
        problems: Sequence[LabelingProblem],
        labelings: Sequence[NDArray[np.int64]],
        weights: Sequence[NDArray[np.float64]] | None,
    ) -> bool:
        """Whether nodes without a label take part in learning."""

    @abstractmethod
    def _task(self, ready: PreparedProblems, counts: NDArray[np.float64] | None) -> Any:
        """The learning task, of nodes weighted by ``counts`` (N,)."""

    @abstractmethod
    def _terms(self, task: Any) -> MaxMarginProblem | TableField:
        """The scores of a task as a function of flat weights."""

    @abstractmethod
    def _weights_per_edge(self, ready: PreparedProblems) -> int:
        """The number of weights of each edge feature."""

    @abstractmethod
    def _selection(self, data: TrainingSet) -> Selection:
        """The options that label held-out nodes best."""

    @abstractmethod
    def _learn(self, data: TrainingSet, chosen: Selection, on_iteration: OnStep | None) -> Learned:
        """Learn with these options."""

    @abstractmethod
    def _path(self, task: Any, part: NDArray[np.bool_], learner: str) -> Path:
        """Learning without the nodes ``part`` (N,), for one C after another."""

    def _held_out_choice(
        self,
        data: TrainingSet,
        kinds: tuple[Sequence[str], Sequence[str]],
        penalties: Sequence[float],
        usual: float,
        alone: NDArray[np.int64] | None = None,
    ) -> Choice:
        """The node features, learner and C that label held-out parts best."""
        task = data.prepared(kinds[0][0])[1]
        return choose(
            task.labels,
            task.loss > 0,
            searched_parts(data.examples, self.n_validation_blocks),
            kinds,
            penalties,
            usual,
            lambda part, name, learner: self._path(data.prepared(name)[1], part, learner),
            alone,
            steps=np.concatenate([linked_steps(problem.graph) for problem, _ in data.examples]),
        )

    def _loss_of(self, names: Sequence[str]) -> LossOf:
        """Cost of a wrong label at nodes with these true labels."""
        weight = self.class_weight if self.loss == "class-weighted" else "none"
        return lambda labels: node_losses(labels, names, weight)

    @abstractmethod
    def _node_columns(self, problem: LabelingProblem, parts: str) -> NDArray[np.float64]:
        """(N, D) the node features of a problem before they are scaled."""

    @abstractmethod
    def _edge_columns(self, problem: LabelingProblem) -> NDArray[np.float64]:
        """(E, F) the edge features of a problem, unscaled."""

    @abstractmethod
    def _edge_sizes(self, problems: Sequence[LabelingProblem]) -> NDArray[np.float64]:
        """(F,) divisors of the edge features during learning."""

    def _prepared(self, examples: Sequence[Example], parts: str) -> PreparedProblems:
        """The training problems as one, with node features of these ``parts``."""
        problems = [problem for problem, _ in examples]
        require_like_cliques(problems)
        raw = [self._node_columns(problem, parts) for problem in problems]
        scaling = self._scaling() if self._is_warm else Standardization.of_all(raw, self.scale)
        of_cliques = clique_sizes(problems)
        if self.scale == "none":
            of_cliques = np.ones_like(of_cliques)
        sizes = TermSizes(self._edge_sizes(problems), of_cliques)
        starts = np.cumsum([0, *(problem.graph.n_nodes for problem in problems[:-1])])
        edges = [p.graph.edges + start for p, start in zip(problems, starts, strict=True)]
        sets = [clique_terms(problem, self.clique_dissent, of_cliques) for problem in problems]
        labels = np.concatenate([truth for _, truth in examples])
        observed = observed_labels(problems)
        loss_of, loss = self._loss_of(problems[0].label_names), np.zeros(len(labels))
        loss[labels >= 0] = loss_of(labels[labels >= 0])
        return PreparedProblems(
            scaling,
            sizes,
            scaling.apply(stacked_rows(raw)),
            np.concatenate(edges),
            np.concatenate([self._edge_columns(problem) for problem in problems]) / sizes.edges,
            SetTerms.beside([each for each in sets if each is not None], starts),
            labels,
            mask_observed_losses(loss, observed),
            observed,
            loss_of,
            problems[0].n_labels,
            all(problem.graph.is_chain for problem in problems),
            self._offset(problems, parts),
        )

    def _offset(
        self, problems: Sequence[LabelingProblem], parts: str
    ) -> NDArray[np.float64] | None:
        """(N, K) fixed scores of all nodes, None without an offset."""
        names = parse_node_features(parts, with_offset=True)
        offsets = [node_offset(problem, names) for problem in problems]
        return np.concatenate([x for x in offsets if x is not None]) if OFFSET in names else None

    def _warm_start(
        self, sizes: NDArray[np.float64], ready: PreparedProblems
    ) -> NDArray[np.float64] | None:
        """The warm start: the flat weights times ``sizes``; or None."""
        if not self._is_warm:
            return None
        parts = self._learned("node_weights", self._edge_array)
        if self._weights_per_edge(ready) == 1:
            parts[1] = parts[1][:, :1]
        of_cliques = [] if self.clique_weights is None else [self.clique_weights]
        weights = np.concatenate([part.ravel() for part in (*parts, *of_cliques)])
        if len(weights) != len(sizes) or parts[0].shape[1] != ready.n_labels:
            raise InputError(
                "warm_start needs problems with the model's labels and features: it has "
                f"{len(weights)} weights, these problems need {len(sizes)}"
            )
        return weights * sizes
