"""Lists that score the cells of one map while their features stream past."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.layout import GridLayout
from pgm_places.models.boosted_list import BoostedList
from pgm_places.unary.space_model import MapSpaces, SpaceModel

__all__ = ["CellList", "ContextPart", "LaserList", "SpaceList", "aligned_log_proba", "on_labels"]


class CellList(Protocol):
    """Takes the features of cells block by block, and holds what it makes of them.

    Attributes
    ----------
    unary : str
        What its scores are called.
    columns : (n,) int64
        The laser and custom columns that it looks at, ascending.
    found : (N, K) float64
        The scores of the nodes.
    """

    unary: str
    columns: NDArray[np.int64]
    found: NDArray[np.float64]

    def expect(self, columns: NDArray[np.int64]) -> None:
        """Say which columns the blocks will have, its own among them."""

    def take(
        self, nodes: NDArray[np.int64], values: NDArray[np.float32], n_threads: int | None
    ) -> None:
        """Score some nodes by the expected columns (n, F)."""


class LaserList:
    """The list on laser and custom features."""

    unary = "laser"

    def __init__(self, fitted: BoostedList, n_nodes: int, n_labels: int) -> None:
        self.fitted, self.n_labels = fitted, n_labels
        self.columns = fitted.used_features
        self.found = np.empty((n_nodes, n_labels))

    def expect(self, columns: NDArray[np.int64]) -> None:
        """Say which columns the blocks will have."""
        self.part = self.fitted.restricted(columns)

    def take(
        self, nodes: NDArray[np.int64], values: NDArray[np.float32], n_threads: int | None
    ) -> None:
        """Score some nodes."""
        self.found[nodes] = aligned_log_proba(self.part, values, self.n_labels, n_threads)


class ContextPart:
    """The votes that the list with context casts on laser and custom features.

    It waits for the scores all around; its stumps on the scans vote now, so that the scans'
    features need not be kept.
    """

    unary = "context"

    def __init__(self, fitted: BoostedList, n_own: int, n_nodes: int, n_labels: int) -> None:
        self.fitted = fitted
        used = fitted.used_features
        self.columns = np.asarray(used[used < n_own], np.int64)
        self.found = np.empty((n_nodes, n_labels))

    def expect(self, columns: NDArray[np.int64]) -> None:
        """Say which columns the blocks will have."""
        self.part = self.fitted.part(columns)

    def take(
        self, nodes: NDArray[np.int64], values: NDArray[np.float32], n_threads: int | None
    ) -> None:
        """Let the stumps vote on some nodes."""
        votes = self.part.scores(values, n_threads=n_threads)
        self.found[nodes, : len(votes)] = votes.T


class SpaceList:
    """The list that also sees the spaces around cells."""

    unary = "space"

    def __init__(
        self, model: SpaceModel, spaces: MapSpaces, layout: GridLayout, n_own: int, n_labels: int
    ) -> None:
        used = model.classifier.used_features
        self.model, self.spaces, self.layout, self.n_labels = model, spaces, layout, n_labels
        self.columns = np.asarray(used[used < n_own], np.int64)
        self.of_spaces = np.asarray(used[used >= n_own], np.int64) - n_own
        self.part = model.classifier.restricted(used)
        self.found = np.empty((len(layout.cells_rc), n_labels))

    def expect(self, columns: NDArray[np.int64]) -> None:
        """Say which columns the blocks will have."""
        self.places = np.searchsorted(columns, self.columns)

    def take(
        self, nodes: NDArray[np.int64], values: NDArray[np.float32], n_threads: int | None
    ) -> None:
        """Score some nodes, doorways weighed by their gates."""
        around = self.spaces.features.lookup(self.layout.cells_rc[nodes])[:, self.of_spaces]
        both = np.concatenate([values[:, self.places], around], axis=1)
        self.found[nodes] = aligned_log_proba(self.part, both, self.n_labels, n_threads)

    def finish(self) -> None:
        """Weigh doorways by the gates, once all nodes are scored."""
        self.found = self.model.with_gates(self.found, self.spaces, self.layout)


def aligned_log_proba(
    fitted: BoostedList, values: NDArray[np.float32], n_labels: int, n_threads: int | None = None
) -> NDArray[np.float64]:
    """(N, K) log z with one column per label index, also for labels the list never saw."""
    return on_labels(fitted, fitted.log_histogram(values, n_threads=n_threads), n_labels)


def on_labels(
    fitted: BoostedList, found: NDArray[np.float64], n_labels: int
) -> NDArray[np.float64]:
    """(N, K) log z of a list's own classes, with a column per label index."""
    classes = np.asarray(fitted.classes, np.int64)
    if len(classes) == n_labels:
        return found
    full = np.full((len(found), n_labels), found.min(initial=0.0))
    full[:, classes] = found
    return full
