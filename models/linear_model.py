"""Base class of linear structured models: shared options, learned arrays, record of learning."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._arguments import travels
from pgm_places._checks import (
    finite_array,
    integer_array,
    learned_number,
    require_type,
    set_frozen,
)
from pgm_places.errors import InputError, NotFittedError
from pgm_places.inference.backends import LearnedNames, Traits, in_learned_order, learned
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.potentials import Potentials
from pgm_places.inference.problem import ONE_BY_ONE, LabelingProblem
from pgm_places.models.cliques import (
    check_clique_weights,
    decode_cliques_as,
    learned_rewards,
)
from pgm_places.models.decoders import Decoder
from pgm_places.models.feature_scaling import CLIP, Scale, Standardization
from pgm_places.models.held_out_choice import (
    NODE_CHOICES,
    check_choices,
    choice_record,
    choice_words,
)
from pgm_places.models.labelled_examples import ClassWeight
from pgm_places.models.learning_record import LENGTHS, LearningRecord
from pgm_places.models.linear_features import (
    parse_edge_features,
    parse_node_features,
    resolved_edges,
)
from pgm_places.options import AtLeastZero, Positive, Whole, check_options
from pgm_places.options.marks import Ge, Gt, Le, Lt
from pgm_places.solvers.max_margin import checked_costs


@travels
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearModel(LearnedNames):
    """Options and learned arrays shared by associative networks and conditional random fields.

    Parameters
    ----------
    n_validation_blocks : int
        Number of parts that are held out in turn to compare several C.
    loss : {"class-weighted", "hamming"} or (K, K) float
        Cost of a wrong label in max-margin learning. ``hamming`` counts nodes, which sacrifices
        uncertain rare labels; ``class-weighted`` costs more for rare labels; a table has the cost
        of each label (column) for each true one (row), 0 on the diagonal, scaled to mean 1.
    class_weight : {"two-thirds", "sqrt", "cube-root", "inverse", "none"} or mapping
        A node of a label with share f of the nodes costs ``f**-p`` with p = 2/3, 1/2, 1/3, 1 or
        0, or the weight of its label in the mapping (1 for other labels), scaled to mean 1. Only
        for the class-weighted loss.
    node_features : str
        Parts joined by ``+``: ``logz`` (log-probabilities of the unary), ``z`` (probabilities),
        ``raw`` (the problem's node features). ``auto`` is ``logz`` and ``raw`` if available; with
        both, ``raw`` is used only if it labels held-out parts better by a point. Repeated columns
        are dropped, the rest is standardised, and a constant is added.
    edge_features : tuple of str
        ``constant``, ``diagonal``, ``kind``, ``unary-difference``, ``raw-difference``,
        ``given``; or ``auto``. See :func:`pgm_places.models.linear_features.edge_features`.
    clique_dissent : float
        The share of its nodes, up to a half, that may differ before a set of the problem's
        ``cliques`` earns nothing. Rewards by label are learned by max margin from a constant and
        the problem's ``clique_features``; see :mod:`pgm_places.solvers.set_terms`.
    learning_tolerance : float
        Relative gap at which learning ends.
    time_limit_s : float, optional
        Learning ends after this many seconds with the best weights so far.
    warm_start : bool
        Whether ``fit`` of a fitted model starts at its weights, with its scaling of the features:
        with a few more problems it needs fewer steps to the same minimum.
    max_iterations : int, optional
        Limit of the decoder's iterations instead of its own.
    certify : bool
        Whether ``infer`` adds an upper bound of the best score if the decoder has none.
    scale : {"auto", "deviation", "none"}
        Scaling of features before learning, so that their units do not matter. ``auto``
        standardises node features and clips them to +-5, but leaves columns of zeros and ones
        unchanged, and divides sparse columns and the ``given`` features of edges and cliques by
        their size; ``deviation`` standardises all node features; ``none`` changes none. See
        :class:`pgm_places.models.feature_scaling.Standardization`.
    """

    traits: ClassVar[Traits] = Traits(
        sees_parts_alone=True, labelling_options=("inference", "max_iterations", "certify")
    )

    _has_offset: ClassVar[bool] = False

    n_validation_blocks: Annotated[int, Ge(2)] = 4
    loss: Literal["class-weighted", "hamming"] | tuple[tuple[AtLeastZero, ...], ...] = (
        "class-weighted"
    )
    class_weight: ClassWeight = "cube-root"
    node_features: str = "auto"
    edge_features: str | tuple[str, ...] = ("auto",)
    clique_dissent: Annotated[float, Gt(0), Le(0.5)] = 0.5
    learning_tolerance: Annotated[float, Gt(0), Lt(1)] = 1e-3
    time_limit_s: Positive | None = None
    warm_start: bool = False
    max_iterations: Whole | None = None
    certify: bool = False
    scale: Scale = "auto"
    node_weights: NDArray[np.float64] | None = learned()
    clique_weights: NDArray[np.float64] | None = learned()
    feature_columns: NDArray[np.int64] | None = learned()
    feature_mean: NDArray[np.float64] | None = learned()
    feature_scale: NDArray[np.float64] | None = learned()
    feature_clip: NDArray[np.float64] | None = learned()
    n_features: NDArray[np.int64] | None = learned()
    learning: NDArray[np.float64] | None = learned()
    node_choice: NDArray[np.int64] | None = learned()
    learning_history: NDArray[np.float64] | None = learned()
    penalty_search: NDArray[np.float64] | None = learned()

    def __post_init__(self) -> None:
        check_options(self)
        parse_node_features(self.node_features, with_offset=self._has_offset)
        if not isinstance(self.loss, str):
            checked_costs(self.loss, len(self.loss))
        set_frozen(self, edge_features=parse_edge_features(self.edge_features))
        if self.node_weights is not None:
            self._check_learned()

    def with_options_in(self, order: NDArray[np.int64]) -> Self:
        """The model with label ``order[k]`` at index k of a loss table."""
        if isinstance(self.loss, str):
            return self
        table = checked_costs(self.loss, len(order))[np.ix_(order, order)]
        return replace(self, loss=tuple(map(tuple, table.tolist())))

    @property
    def summary(self) -> Mapping[str, Any]:
        """The record of learning by name: status, C, learner, bounds, gap, seconds, sizes.

        ``held_out`` has the compared options with their scores on held-out parts.
        """
        self._learned("node_weights")
        if self.learning is None:
            return {}
        record = dict(LearningRecord.from_array(self.learning).summary())
        record["node_features"] = self._node_parts
        return {**record, "held_out": choice_record(self.penalty_search, record)}

    @property
    def choices(self) -> Mapping[str, str]:
        """The choices on training data, in words by option; {} before learning."""
        return {} if self.node_weights is None else choice_words(self.summary)

    @property
    def _node_parts(self) -> str:
        """The node features, chosen or set."""
        if self.node_choice is None:
            return self.node_features
        chosen = learned_number("node_choice", self.node_choice, 0, len(NODE_CHOICES))
        return NODE_CHOICES[chosen] if chosen else self.node_features

    def _node_choices(self, problems: Sequence[LabelingProblem]) -> tuple[str, ...]:
        """The node features to compare on held-out parts; more than one for ``auto``."""
        if self._is_warm:
            return (self._node_parts,)
        both = all(p.unary is not None and p.node_features is not None for p in problems)
        return NODE_CHOICES[1:3] if self.node_features == "auto" and both else (self.node_features,)

    @property
    def _is_warm(self) -> bool:
        """Whether learning is warm-started from earlier weights."""
        return self.warm_start and self.node_weights is not None

    def edge_names(self, problem: LabelingProblem) -> tuple[str, ...]:
        """The edge features of a problem, with ``auto`` resolved."""
        return tuple(resolved_edges(problem, self.edge_features))

    @in_learned_order
    def clique_rewards(self, problem: LabelingProblem) -> NDArray[np.float64]:
        """(C, K) reward per node of a clique whose nodes all have a label."""
        return learned_rewards(problem, self.clique_weights)

    def _learned(self, *names: str) -> list[NDArray[Any]]:
        """Learned arrays by name; NotFittedError if one is missing."""
        arrays = [getattr(self, name) for name in names]
        if any(array is None for array in arrays):
            raise NotFittedError(
                f"this {type(self).__name__} has not learned yet; call fit(problems, labelings)"
            )
        return arrays

    def _costs(self, n_labels: int) -> NDArray[np.float64] | None:
        """(K, K) costs of confusions, scaled to a mean of 1; None if all are equal."""
        if isinstance(self.loss, str):
            return None
        costs = checked_costs(self.loss, n_labels)
        return costs * (n_labels * (n_labels - 1) / costs.sum())

    def _scaling(self) -> Standardization:
        count, columns, mean, scale = self._learned(
            "n_features", "feature_columns", "feature_mean", "feature_scale"
        )
        clip = CLIP if self.feature_clip is None else float(self.feature_clip[0])
        return Standardization(int(count[0]), columns, mean, scale, clip)

    def _require_labels(self, problem: LabelingProblem) -> None:
        """Raise InputError unless this is a problem with the labels of training."""
        [node_weights] = self._learned("node_weights")
        require_type("the problem", problem, LabelingProblem, ONE_BY_ONE)
        if problem.n_labels != node_weights.shape[1]:
            raise InputError(
                f"the model was trained on {node_weights.shape[1]} labels, this problem has "
                f"{problem.n_labels}"
            )

    def _decoded(
        self, problem: LabelingProblem, potentials: Potentials, inference: Decoder
    ) -> Labeling:
        """A decoder's labelling, with the record of learning in ``info["learning"]``."""
        rewards = self.clique_rewards(problem)
        labeling = decode_cliques_as(self, problem, potentials, inference, rewards)
        return replace(labeling, info={**labeling.info, "learning": self.summary})

    def _check_learned(self) -> None:
        """Check that learned arrays, which may come from a file, are consistent."""
        [node_weights] = self._learned("node_weights")
        scaling = self._scaling()
        n_kept = len(scaling.columns)
        finite_array("node_weights", node_weights, (n_kept + 1, node_weights.shape[-1]))
        integer_array("feature_columns", scaling.columns, (n_kept,), low=0, high=scaling.n_columns)
        finite_array("feature_mean", scaling.mean, (n_kept,))
        if (finite_array("feature_scale", scaling.scale, (n_kept,)) <= 0).any():
            raise InputError("feature_scale must be positive")
        if self.feature_clip is not None and not (
            self.feature_clip.shape == (1,) and self.feature_clip[0] > 0
        ):
            raise InputError("feature_clip must hold one positive number")
        check_clique_weights(self.clique_weights, node_weights.shape[1])
        if self.learning is not None and self.learning.shape not in [(n,) for n in LENGTHS]:
            raise InputError(f"learning must hold {LENGTHS[-1]} numbers, got {self.learning.shape}")
        if self.node_choice is not None and not (
            self.node_choice.shape == (1,) and 0 <= self.node_choice[0] < len(NODE_CHOICES)
        ):
            raise InputError(f"node_choice must hold one number below {len(NODE_CHOICES)}")
        check_choices(self.penalty_search)


def require_edge_features(count: int, n_known: int) -> None:
    """Raise InputError if the number of edge features differs from training."""
    if count != n_known:
        raise InputError(
            f"the model was trained on {n_known} edge features, this problem has {count}; "
            "compute them as for training"
        )
