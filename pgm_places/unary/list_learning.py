"""Boosted lists: fitted, cross-fitted and calibrated on examples, and their scores of cells."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.evaluation.folds import cross_fit, held_out_scores
from pgm_places.floor.view import FloorScores
from pgm_places.inference.temperature import likeliest_temperature
from pgm_places.models.boosted_list import BoostedList, list_average
from pgm_places.progress import report_stage
from pgm_places.unary.cell_scorers import aligned_log_proba, without_halls
from pgm_places.unary.floor_model import FloorModel, with_floor
from pgm_places.unary.map_model import LASER_SHARE, log_mean
from pgm_places.unary.options import MIXED
from pgm_places.unary.space_model import LearnedSpaces, SpaceModel
from pgm_places.unary.training_cells import TrainingCells

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

RAREST_FIRST = "rarest-first"
"""An order of labels that PlaceLabeler adds to the orders of the list."""


def with_explicit_order(
    classifier: "DecisionListClassifier", truth: NDArray[np.int64]
) -> "DecisionListClassifier":
    """The list with ``"rarest-first"`` written out as the labels by increasing frequency.

    As the first label of the list, a rare label is separated from all others by one classifier; as
    the last, it gets the remaining nodes. The paper's heuristic puts it last, as the hardest label.
    """
    if not (isinstance(classifier.order, str) and classifier.order == RAREST_FIRST):
        return classifier
    labels, counts = np.unique(truth, return_counts=True)
    order = labels[np.argsort(counts, kind="stable")].tolist()
    return like(classifier, order=order)


@dataclass(frozen=True, eq=False)
class Rows:
    """Training examples of lists."""

    features: NDArray[np.float32]  # (n, F)
    truth: NDArray[np.int64]  # (n,) label index of each row
    groups: NDArray[np.int64] | None  # (n,) index of the fold of each row
    # (n,) -1 for rows that all lists use; see :func:`fitted_list`
    domain: NDArray[np.int64] | None = None

    def where(self, mask: NDArray[np.bool_]) -> "Rows":
        """The rows in a mask (n,)."""
        groups, domain = (
            None if part is None else part[mask] for part in (self.groups, self.domain)
        )
        return Rows(self.features[mask], self.truth[mask], groups, domain)


def fitted_list(unfitted: "DecisionListClassifier", rows: Rows) -> BoostedList:
    """The list fitted on all rows, or the mean of lists that each leave out one domain.

    Errors due to the source of maps differ between lists with and without this source: the labels
    of entire spaces flip, but rarely in most lists at once.
    """
    remaining = without_a_domain(rows.truth, rows.domain)
    if len(remaining) > 1:
        return list_average([_fitted(unfitted, rows.where(mask)) for mask in remaining])
    return _fitted(unfitted, rows)  # a mask would copy all of them


def _fitted(unfitted: "DecisionListClassifier", rows: Rows) -> BoostedList:
    fitted = like(unfitted).fit(rows.features, rows.truth, groups=rows.groups)
    boosted: BoostedList = fitted.boosted_list_
    return boosted


def without_a_domain(
    truth: NDArray[np.int64], domain: NDArray[np.int64] | None
) -> list[NDArray[np.bool_]]:
    """The rows without each domain, if all labels remain; all rows if that is one set."""
    everything = np.ones(len(truth), np.bool_)
    if domain is None:
        return [everything]
    remaining = [domain != number for number in np.unique(domain[domain >= 0])]
    n_labels = len(np.unique(truth))
    complete = [mask for mask in remaining if len(np.unique(truth[mask])) == n_labels]
    return complete if len(complete) > 1 else [everything]


def cross_fitted(
    unfitted: "DecisionListClassifier", rows: Rows, name: str, *, held_out: bool = True
) -> tuple[BoostedList, dict[int, BoostedList]]:
    """The list fitted on all rows and, for each group, a list fitted without it.

    All have one order of labels. With domains, each is the mean of lists that each leave out one
    domain.
    """
    with report_stage(name):
        fitted = fitted_list(unfitted, rows)
    groups = rows.groups
    if not held_out or groups is None:
        return fitted, {}

    def fit(fold: int) -> BoostedList:
        others = replace(rows, groups=None).where(groups != fold)
        chosen = fitted.classes[fitted.order].tolist()
        order = [label for label in chosen if (others.truth == label).any()]
        if len(order) < 2:
            raise InputError(
                "out-of-fold scores need at least two labels outside every group; "
                "use fewer folds or learn_on='in-sample'"
            )
        return fitted_list(like(unfitted, order=order), others)

    return fitted, cross_fit(groups, fit, f"held-out scores: {name}")


def scores_of(
    lists: dict[int, BoostedList],
    values: NDArray[np.float32],
    groups: NDArray[np.int64],
    n_labels: int,
) -> NDArray[np.float64]:
    """(n, K) log z of rows, each from the list of its group."""
    return held_out_scores(
        lists, groups, lambda item, rows: aligned_log_proba(item, values[rows], n_labels)
    )


def with_temperatures(
    fitted: BoostedList, lists: dict[int, BoostedList], rows: Rows
) -> tuple[BoostedList, dict[int, BoostedList]]:
    """A list and its held-out lists, with temperatures fitted on held-out examples.

    The log-odds of each classifier are multiplied by the factor with the largest likelihood of the
    held-out examples (:func:`pgm_places.models.list_training.temperature`). Lists without a label,
    because no other group has it, are left out and not changed.
    """
    from pgm_places.models.list_training import temperature

    complete = {fold: item for fold, item in lists.items() if item.order.size == fitted.order.size}
    order = fitted.classes[fitted.order]
    logits, label = [], []
    for fold, item in complete.items():
        unseen = rows.groups == fold
        slope, offset = item.calibration.T[:, :, None]
        logits.append(slope * item.scores(rows.features[unseen]) + offset)
        label.append(rows.truth[unseen])
    if not complete:
        return fitted, lists
    odds, labels = np.concatenate(logits, axis=1), np.concatenate(label)
    factor = np.ones((len(order) - 1, 1))
    for i, k in enumerate(order[:-1]):
        mine = np.isin(labels, order[i:])
        factor[i] = temperature(odds[i, mine], labels[mine] == k, np.ones(int(mine.sum())))
    scaled = {
        fold: replace(item, calibration=factor * item.calibration)
        for fold, item in complete.items()
    }
    return replace(fitted, calibration=factor * fitted.calibration), {**lists, **scaled}


def like(estimator: "DecisionListClassifier", **options: Any) -> "DecisionListClassifier":
    """The same estimator, not fitted, with some options changed."""
    from sklearn.base import clone

    other: DecisionListClassifier = clone(estimator).set_params(**options)
    return other


# Additional columns (n, D) of cells, by their indices.
Extra = Callable[[NDArray[np.int64]], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Lists:
    """A list fitted on all examples and, if there are folds, a held-out list for each."""

    fitted: BoostedList
    of_fold: dict[int, BoostedList]
    cells: TrainingCells
    n_labels: int
    extra: Extra | None

    def scores(self, *, held_out: bool) -> NDArray[np.float64]:
        """(N, K) log z of all cells, from the fitted list or from held-out lists."""
        return self._held_out_scores if held_out else self._all_scores(held_out=False)

    @cached_property
    def _held_out_scores(self) -> NDArray[np.float64]:
        return self._all_scores(held_out=True)

    def _all_scores(self, *, held_out: bool) -> NDArray[np.float64]:
        scores = np.empty((len(self.cells.truth), self.n_labels))
        for some, values in self.cells.blocks():
            scores[some] = self._of(some, with_extra(values, some, self.extra), held_out)
        return scores

    def scores_of_examples(self, *, held_out: bool) -> NDArray[np.float64]:
        """(n, K) log z of the examples, from the fitted list or from held-out lists."""
        examples = self.cells.examples
        return self._of(examples, with_extra(self.cells.features, examples, self.extra), held_out)

    def _of(
        self, some: NDArray[np.int64], values: NDArray[np.float32], held_out: bool
    ) -> NDArray[np.float64]:
        if not held_out:
            return aligned_log_proba(self.fitted, values, self.n_labels)
        groups = self.cells.groups[some]
        return scores_of(self.of_fold, values, groups, self.n_labels)


@dataclass(frozen=True, eq=False)
class SpaceLists:
    """Lists with space features, and the gates that weight their doorway scores."""

    lists: Lists
    spaces: LearnedSpaces
    corridor: int | None

    @property
    def model(self) -> SpaceModel:
        """The fitted model."""
        spaces = self.spaces
        return SpaceModel(self.lists.fitted, spaces.gates, spaces.doorway, self.corridor)

    def scores(self, *, held_out: bool) -> NDArray[np.float64]:
        """(N, K) log z of all cells, with halls added to corridors, and gate weights."""
        log_z = self.lists.scores(held_out=held_out)
        if self.corridor is not None:
            log_z, _ = without_halls(log_z, self.corridor)
        return self.spaces.scores(log_z)


@dataclass(frozen=True, eq=False)
class Stages:
    """The lists fitted on some cells, and the networks."""

    cells: TrainingCells
    laser: Lists
    context: Lists | None
    space: SpaceLists | None
    floor: FloorModel | None

    def scores(self, name: str, *, held_out: bool) -> list[NDArray[np.float64]]:
        """(n, K) a unary's scores of the cells of each map."""
        if name == MIXED:
            laser, space = (self.scores(part, held_out=held_out) for part in ("laser", "space"))
            pairs = zip(laser, space, strict=True)
            return [log_mean(one, other, self.exponents) for one, other in pairs]
        if name != "floor":
            stage = getattr(self, name)
            return self.cells.by_map(stage.scores(held_out=held_out))
        assert self.floor is not None
        return [
            with_floor(log_z, self._floor_scores[m], self.floor, self.cells.layout(m))
            for m, log_z in enumerate(self.scores("space", held_out=held_out))
        ]

    @cached_property
    def exponents(self) -> tuple[float, float]:
        """Exponents of laser and space in their mean, from their likelihoods of held-out cells."""
        truths = self.cells.by_map(self.cells.truth)
        hot = [
            likeliest_temperature(
                [np.exp(part) for part in self.scores(name, held_out=True)], truths
            )
            for name in ("laser", "space")
        ]
        return LASER_SHARE / hot[0], (1.0 - LASER_SHARE) / hot[1]

    @cached_property
    def _floor_scores(self) -> list[FloorScores]:
        assert self.floor is not None
        return [self.floor.scores(item.grid) for item in self.cells.maps]


def with_extra(
    values: NDArray[np.float32], cells: NDArray[np.int64], extra: Extra | None
) -> NDArray[np.float32]:
    """(n, F) rows of cells with additional columns."""
    return values if extra is None else np.concatenate([values, extra(cells)], axis=1)
