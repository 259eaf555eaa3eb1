"""Options of the boosted lists, and the choice of a unary by held-out balanced accuracy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError
from pgm_places.evaluation.evaluation import balanced_accuracy, confusion_matrix
from pgm_places.models.list_options import ListOptions, PriorWeight
from pgm_places.options import Options, Positive, option_values, subset_of
from pgm_places.options.marks import Ge, Gt, Le

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier


# How far z follows the label frequencies of training: at 0 rare labels are predicted too often,
# at 1 too rarely; halfway preserved accuracy and balanced accuracy on held-out buildings.
PRIOR_WEIGHT = 0.5

MIXED = "laser+space"

UNARIES = ("laser", "context", MIXED, "space", "floor")
"""Names of the unaries, the simplest first."""

HallsAs = Literal["corridor", "room", "hall"]
"""The label given to halls."""

LearnOn = Literal["out-of-fold", "in-sample"]
NumberOfFolds = Annotated[int, Ge(2), Le(50)]
NumberOfExamples = Annotated[int, Ge(100)]
NumberOfNodeFeatures = Annotated[int, Ge(1), Le(321)]
WindowsM = tuple[Positive, ...]


@dataclass(frozen=True)
class ClassifierOptions(ListOptions):
    """Options of the list and of its training on maps.

    Parameters
    ----------
    order : {"rarest-first", "heuristic", "exhaustive"} or list of label names
        Order of the labels in the list: by increasing frequency in training, by the paper's
        heuristic, or the best of all on held-out cells. A list of names may omit the last label.
    max_examples_per_map : int, optional
        Train the lists on a random sample of this many cells per map; all cells by default.
    learn_on : {"out-of-fold", "in-sample"}
        Scores that structured methods are trained on: those of held-out cells (whole buildings, or
        contiguous blocks if there is only one), or those of cells that the list was trained on.
    n_folds : int
        Folds of the held-out scores.
    n_node_features : int
        Number of features passed to structured methods: the first ones chosen by boosting.
    prior_weight : float or "auto"
        As of :class:`~pgm_places.models.list_options.ListOptions`; ``"auto"`` is 0.5 for cells of
        maps and nodes of graphs, and 0 for steps of drives, whose method knows how frequent labels
        are.
    """

    prior_weight: PriorWeight | Literal["auto"] = "auto"  # type: ignore[assignment]
    order: Literal["rarest-first", "heuristic", "exhaustive"] | tuple[str, ...] = "rarest-first"
    max_examples_per_map: NumberOfExamples | None = None
    learn_on: LearnOn = "out-of-fold"
    n_folds: NumberOfFolds = 5
    n_node_features: NumberOfNodeFeatures = 30

    def classifier(
        self, label_names: Sequence[str], *, auto_prior: float = PRIOR_WEIGHT
    ) -> "DecisionListClassifier":
        """The unfitted list; an order of names becomes one of label numbers.

        ``auto_prior`` is what ``prior_weight="auto"`` stands for.
        """
        from pgm_places.models.decision_list import DecisionListClassifier

        order: Any = self.order
        if isinstance(order, tuple):
            rest = [name for name in label_names if name not in order]
            order = [list(label_names).index(name) for name in (*order, *rest)]
        weight = auto_prior if self.prior_weight == "auto" else self.prior_weight
        shared = option_values(subset_of(ListOptions, replace(self, prior_weight=weight)))
        return DecisionListClassifier(order=order, **shared)


@dataclass(frozen=True)
class ContextOptions(Options):
    """The list with context: mean scores in windows around each cell.

    Parameters
    ----------
    half_widths_m : list of float
        Half-widths of the windows, chosen on training buildings (docs/results); an empty list
        disables the second list, which serves the methods with ``unary = "context"``.
    """

    half_widths_m: WindowsM = (0.3, 0.75, 1.5, 3.0)


@dataclass(frozen=True)
class SpaceOptions(ListOptions):
    """The list of trees with features of the space around a cell in addition to its scan.

    It serves the methods with ``unary = "space"``. Its columns are the shape of the segments of
    free space at three scales, and of the places between doorways (docs/gates.md); which openings
    are doorways is learned first.

    Parameters
    ----------
    doorway_label : str
        The label of doorways; if it is not among the labels, no opening counts as a doorway.
    max_examples_per_map : int
        Train the list on a random sample of at most this many of each map's examples: trees take
        longer than stumps, and neighbouring cells add little information.
    """

    n_rounds: Annotated[int, Ge(1), Le(100_000)] = 100
    max_depth: Annotated[int, Ge(1), Le(4)] = 4
    shrinkage: Annotated[float, Gt(0), Le(1)] = 0.3
    feature_share: Annotated[float, Gt(0), Le(1)] = 0.25
    calibration: Literal["none", "platt", "temperature"] = "temperature"
    prior_weight: PriorWeight = 0.5
    doorway_label: str = "doorway"
    max_examples_per_map: NumberOfExamples = 20_000

    def classifier(self) -> "DecisionListClassifier":
        """The unfitted list, with the rarest label first."""
        from pgm_places.models.decision_list import DecisionListClassifier

        return DecisionListClassifier(
            order="rarest-first", **option_values(subset_of(ListOptions, self))
        )

    def doorway(self, label_names: Sequence[str]) -> int | None:
        """The index of the doorway label among these names, None if there is none."""
        names = list(label_names)
        return names.index(self.doorway_label) if self.doorway_label in names else None


GATE_OPTIONS: dict[str, Any] = {
    "n_rounds": 100,
    "max_depth": 3,
    "shrinkage": 0.2,
    "prior_weight": 1.0,
}
"""Options of the list of gates; chosen on held-out buildings."""


HeldOut = Literal["buildings", "blocks"]


@dataclass(frozen=True)
class UnaryChoice:
    """The unary chosen on training data, and the held-out score of each candidate.

    Parameters
    ----------
    unary : str
        ``laser``, ``context``, ``laser+space``, ``space`` or ``floor``.
    scores : mapping of str to float
        Held-out balanced accuracy of each, 0 to 1: the mean over buildings or blocks.
    held_out : {"buildings", "blocks"}
        What is held out: the building of a cell, or its contiguous block.
    """

    unary: str
    scores: Mapping[str, float]
    held_out: HeldOut

    @classmethod
    def of(cls, parts: Mapping[str, ArrayLike], held_out: HeldOut) -> Self:
        """The choice by the balanced accuracy (P,) of each candidate in each building or block.

        It is the first candidate, unless others are ahead of it by more than one standard error of
        the mean of the P paired differences; then the best of these.

        Examples
        --------
        >>> parts = {"laser+space": [0.9, 0.9, 0.9], "laser": [0.88, 0.9, 0.86]}
        >>> UnaryChoice.of({**parts, "space": [0.93, 0.92, 0.94]}, "buildings").unary
        'space'
        >>> UnaryChoice.of({**parts, "space": [0.99, 0.99, 0.75]}, "buildings").unary
        'laser+space'
        """
        values = {name: np.asarray(part, np.float64) for name, part in parts.items()}
        scores = {name: float(part.mean()) for name, part in values.items()}
        first = next(iter(values))
        ahead = [name for name, part in values.items() if _is_ahead(part - values[first])]
        return cls(max(ahead, key=scores.__getitem__) if ahead else first, scores, held_out)

    @property
    def words(self) -> str:
        """The choice and the scores in one line.

        Examples
        --------
        >>> scores = {"laser": 0.88, "context": 0.912, "space": 0.741}
        >>> UnaryChoice("context", scores, "buildings").words
        'context (held-out balanced accuracy 91.2; laser 88.0, space 74.1)'
        """
        shown = {name: f"{100 * score:.1f}" for name, score in self.scores.items()}
        own = shown.pop(self.unary)
        others = ", ".join(f"{name} {score}" for name, score in shown.items())
        return f"{self.unary} (held-out balanced accuracy {own}{others and '; ' + others})"

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """The choice in a manifest.

        Raises
        ------
        InputError
            The record is damaged.
        """
        scores, held_out = record["scores"], record["held_out"]
        known = isinstance(scores, dict) and all(
            name in UNARIES and isinstance(score, float) and 0 <= score <= 1
            for name, score in scores.items()
        )
        if not known or record["unary"] not in scores or held_out not in ("buildings", "blocks"):
            raise InputError(f"unary_choice must name a unary with its scores, got {record!r}")
        return cls(record["unary"], scores, held_out)


def _is_ahead(differences: NDArray[np.float64]) -> bool:
    """Whether the mean of differences (P,) is above 0 by more than its standard error."""
    n = len(differences)
    error = differences.std(ddof=1) / np.sqrt(n) if n > 1 else 0.0
    return bool(differences.mean() > error)


def accuracy_by_part(
    truth: NDArray[np.int64], scores: NDArray[np.float64], parts: NDArray[np.int64], n_labels: int
) -> NDArray[np.float64]:
    """(P,) the balanced accuracy of the best labels of scores (N, K) in each of P parts.

    ``truth`` (N,) are label indices, ``parts`` (N,) the numbers of parts, in ascending order.
    """
    predicted = scores.argmax(axis=1)
    return np.array(
        [
            balanced_accuracy(confusion_matrix(truth[mine], predicted[mine], n_labels))
            for mine in (parts == number for number in np.unique(parts))
        ]
    )
