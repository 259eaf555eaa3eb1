"""Training selection: the cells of a map that a list learns from, with their weights."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from pgm_places.models import boosting_rounds
from pgm_places.models.boosted_list import BoostedList
from pgm_places.models.boosting_rounds import FurtherRounds, TeachingExamples
from pgm_places.options import AtLeastZero, Options
from pgm_places.options.marks import Ge

OF_PAINT_ALONE = ("max_cells_per_class", "seed")
"""The options that also apply to training on paint alone."""


@dataclass(frozen=True)
class TeachingOptions(FurtherRounds, Options):
    """Options of training a labeler further on paint.

    Parameters
    ----------
    max_cells_per_class : int
        Size of the random sample of painted cells of each class.
    n_kept : int
        Size of the random sample of other cells, whose present scores the list is to preserve.
    keep : float
        Total weight of these cells; all painted cells of a class together have weight 1. Boosting
        weights a cell by p (1 - p), so that cells with confident scores count less than this.
    """

    max_cells_per_class: Annotated[int, Ge(10)] = 1000
    n_kept: Annotated[int, Ge(0)] = 1500
    keep: AtLeastZero = 30.0


@dataclass(frozen=True, eq=False)
class CellSelection:
    """Painted cells (n,) to learn from, their classes, and cells (m,) with scores to preserve."""

    nodes: NDArray[np.int64]
    labels: NDArray[np.int64]
    others: NDArray[np.int64]

    @property
    def both(self) -> NDArray[np.int64]:
        """(n + m,) all selected cells, ascending."""
        return np.sort(np.concatenate([self.nodes, self.others]))

    @property
    def weights(self) -> NDArray[np.float64]:
        """(n,) weights with a sum of 1 for each class."""
        counts = np.bincount(self.labels)
        return np.asarray(1.0 / counts[self.labels], np.float64)


def chosen_cells(painted: NDArray[np.int64], options: TeachingOptions) -> CellSelection:
    """The cells of a painting (N,), -1 for unpainted nodes; equal paint gives equal cells."""
    rng = np.random.default_rng(options.seed)
    taken = []
    for label in range(int(painted.max(initial=-1)) + 1):
        members = np.flatnonzero(painted == label)
        taken.append(rng.permutation(members)[: options.max_cells_per_class])
    nodes = np.sort(np.concatenate([np.zeros(0, np.int64), *taken]))
    open_nodes = np.flatnonzero(painted < 0)
    others = np.sort(rng.permutation(open_nodes)[: options.n_kept])
    return CellSelection(nodes, painted[nodes], others)


def learned_further(
    fitted: BoostedList,
    examples: TeachingExamples,
    others: NDArray[np.float32],
    options: TeachingOptions,
) -> BoostedList:
    """A list trained further on painted examples, with its scores of other rows (m, F) preserved.

    Labels are indices into the list's classes; larger ones are new classes, which are placed
    first in the list.
    """
    n_old, n_taught = len(fitted.classes), len(np.unique(examples.labels))
    weight = options.keep * n_taught

    def with_others(subset: TeachingExamples, so_far: BoostedList) -> TeachingExamples:
        if not len(others) or not weight:
            return subset
        return subset.and_also(boosting_rounds.own_opinion(so_far, others, weight))

    boosted = fitted
    if (examples.labels < n_old).any():
        subset = with_others(examples.where(examples.labels < n_old), boosted)
        boosted = boosting_rounds.boosted_further(boosted, subset, options)
    for label in range(n_old, int(examples.labels.max()) + 1):
        subset = with_others(examples.where(examples.labels <= label), boosted)
        number = int(boosted.classes[-1]) + 1
        boosted = boosting_rounds.with_first_class(boosted, number, subset, options)
    return boosted
