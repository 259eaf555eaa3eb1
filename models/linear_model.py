"""What models that are linear in their weights keep of learning, and what follows from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import finite_array, integer_array, require_type
from pgm_places.errors import InputError, NotFittedError
from pgm_places.inference.backends import learned
from pgm_places.inference.labeling import Labeling
from pgm_places.inference.problem import ONE_BY_ONE, LabelingProblem
from pgm_places.models.cliques import check_clique_weights, learned_rewards
from pgm_places.models.learning_record import N_RECORD, LearningRecord, history_array
from pgm_places.models.linear_features import (
    Standardization,
    parse_edge_features,
    parse_node_features,
)
from pgm_places.options import check_options
from pgm_places.solvers.max_margin import LearningStep

__all__ = ["LinearModel", "learned_arrays", "require_edge_features"]


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearModel:
    """The learned arrays that networks and fields share; a model adds its options and its own."""

    node_weights: NDArray[np.float64] | None = learned()
    clique_weights: NDArray[np.float64] | None = learned()
    feature_columns: NDArray[np.int64] | None = learned()
    feature_mean: NDArray[np.float64] | None = learned()
    feature_scale: NDArray[np.float64] | None = learned()
    n_features: NDArray[np.int64] | None = learned()
    learning: NDArray[np.float64] | None = learned()
    learning_history: NDArray[np.float64] | None = learned()
    penalty_search: NDArray[np.float64] | None = learned()

    def __post_init__(self) -> None:
        check_options(self)
        options: Any = self  # each model declares its own
        parse_node_features(options.node_features)
        object.__setattr__(self, "edge_features", parse_edge_features(options.edge_features))
        if self.node_weights is not None:
            self._check_learned()

    @property
    def summary(self) -> Mapping[str, Any]:
        """How learning went, by name: status, C, objective, bounds, gap, seconds, sizes.

        Raises
        ------
        NotFittedError
            The model has not learned.
        """
        self._learned("node_weights")
        if self.learning is None:
            return {}
        return LearningRecord.from_array(self.learning).summary()

    @property
    def _goes_on(self) -> bool:
        """Whether learning begins with what was learned before."""
        return bool(getattr(self, "warm_start", False)) and self.node_weights is not None

    def clique_rewards(self, problem: LabelingProblem) -> NDArray[np.float64]:
        """(C, K) what a clique in which all nodes agree on a label earns for each of them.

        Raises
        ------
        InputError
            Cliques in the problem but not in training, or the other way round; or other features.
        """
        return learned_rewards(problem, self.clique_weights)

    def _learned(self, *names: str) -> list[NDArray[Any]]:
        """Learned arrays by name, all of them there."""
        arrays = [getattr(self, name) for name in names]
        if any(array is None for array in arrays):
            raise NotFittedError(
                f"this {type(self).__name__} has not learned yet; call fit(problems, labelings)"
            )
        return arrays

    def _flat_weights(
        self, parts: Sequence[NDArray[np.float64]], n_weights: int, n_labels: int
    ) -> NDArray[np.float64]:
        """Learned weights, (D, K) of nodes first, as the vector that learning goes on from.

        Raises
        ------
        InputError
            The problems to learn from have other labels or features.
        """
        of_cliques = [] if self.clique_weights is None else [self.clique_weights]
        weights = np.concatenate([part.ravel() for part in (*parts, *of_cliques)])
        if len(weights) != n_weights or parts[0].shape[1] != n_labels:
            raise InputError(
                "warm_start needs the labels and features that the model has learned: it has "
                f"{len(weights)} weights, these problems need {n_weights}"
            )
        return weights

    def _scaling(self) -> Standardization:
        count, *rest = self._learned(
            "n_features", "feature_columns", "feature_mean", "feature_scale"
        )
        return Standardization(int(count[0]), *rest)

    def _require_labels(self, problem: LabelingProblem) -> None:
        """Refuse what is no problem, and one with other labels than in training."""
        [node_weights] = self._learned("node_weights")
        require_type("the problem", problem, LabelingProblem, ONE_BY_ONE)
        if problem.n_labels != node_weights.shape[1]:
            raise InputError(
                f"the model was trained on {node_weights.shape[1]} labels, this problem has "
                f"{problem.n_labels}"
            )

    def _with_summary(self, found: Labeling) -> Labeling:
        """The labelling with how learning went in ``info["learning"]``."""
        return replace(found, info={**found.info, "learning": self.summary})

    def _check_learned(self) -> None:
        """Arrays from a file must fit together before anything is computed with them."""
        [node_weights] = self._learned("node_weights")
        scaling = self._scaling()
        n_kept = len(scaling.columns)
        finite_array("node_weights", node_weights, (n_kept + 1, node_weights.shape[-1]))
        integer_array("feature_columns", scaling.columns, (n_kept,), low=0, high=scaling.n_columns)
        finite_array("feature_mean", scaling.mean, (n_kept,))
        if (finite_array("feature_scale", scaling.scale, (n_kept,)) <= 0).any():
            raise InputError("feature_scale must be positive")
        check_clique_weights(self.clique_weights, node_weights.shape[1])
        if self.learning is not None and self.learning.shape != (N_RECORD,):
            raise InputError(f"learning must hold {N_RECORD} numbers, got {self.learning.shape}")


def require_edge_features(count: int, n_known: int) -> None:
    """Refuse a problem with another number of edge features than in training."""
    if count != n_known:
        raise InputError(
            f"the model was trained on {n_known} edge features, this problem has {count}; make "
            "them the same way as for training"
        )


def learned_arrays(
    scaling: Standardization,
    record: LearningRecord,
    history: tuple[LearningStep, ...],
    search: NDArray[np.float64] | None,
) -> dict[str, Any]:
    """What learning leaves beside the weights, by the names of :class:`LinearModel`."""
    return {
        "feature_columns": scaling.columns,
        "feature_mean": scaling.mean,
        "feature_scale": scaling.scale,
        "n_features": np.array([scaling.n_columns], np.int64),
        "learning": record.to_array(),
        "learning_history": history_array(history),
        "penalty_search": search,
    }
