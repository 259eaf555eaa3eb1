"""Scorers of the cells of one map, fed block by block with streamed features."""

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.threads import run_parts, thread_limit
from pgm_places.models.boosted_list import BoostedList
from pgm_places.spaces.cell_features import NodeFeatures
from pgm_places.unary.feature_table import CachedFeatures
from pgm_places.unary.space_model import MapSpaces, SpaceModel, with_gates

_CELLS_PER_TASK = 1024
"""Number of cells whose laser and space columns one thread concatenates at a time."""


class LaserScorer:
    """Scores by the list on laser and custom features, block by block.

    Attributes
    ----------
    unary : str
        Name of its scores.
    columns : (n,) int64
        The laser and custom columns that it uses, ascending.
    scores : (N, K) float64 or float32
        The scores of the nodes.
    """

    unary = "laser"

    def __init__(
        self, fitted: BoostedList, n_nodes: int, n_labels: int, dtype: DTypeLike = np.float64
    ) -> None:
        self.fitted, self.n_scores = fitted, n_labels
        self.columns = fitted.used_features
        self.scores = np.empty((n_nodes, n_labels), dtype)

    def set_columns(self, columns: NDArray[np.int64]) -> None:
        """Set the columns of the blocks to come."""
        self.expected, self.part = columns, self.fitted.restricted(columns)

    def score_block(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        """Score some nodes by the expected columns (n, F)."""
        self.scores[nodes, : self.n_scores] = self._of(values)

    def score_cached(self, table: CachedFeatures, nodes: NDArray[np.int64]) -> None:
        """Score some nodes of a table, where scores are not cached."""

        def score(some: NDArray[np.int64]) -> NDArray[np.float64]:
            return self._of(table.take(nodes[some], self.expected))

        table.prepare(self.unary, 0, self.n_scores)
        nothing_beside = np.empty((len(nodes), 0), np.float32)
        scores = table.scores(self.unary, nodes, nothing_beside, score)
        self.scores[nodes, : self.n_scores] = scores

    def _of(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        return aligned_log_proba(self.part, values, self.n_scores)


class ContextScorer(LaserScorer):
    """Votes of the list with context on laser and custom features.

    Votes on context follow once all scores are known; stumps on scans vote at once, so that the
    features of scans need not be stored.
    """

    unary = "context"

    def __init__(self, fitted: BoostedList, n_own: int, n_nodes: int, n_labels: int) -> None:
        super().__init__(fitted, n_nodes, n_labels)
        self.n_scores = len(fitted.classes) - 1
        self.columns = np.asarray(self.columns[self.columns < n_own], np.int64)

    def set_columns(self, columns: NDArray[np.int64]) -> None:
        """Set the columns of later blocks."""
        self.expected, self.part = columns, self.fitted.part(columns)

    def _of(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        return self.part.scores(values).T


class SpaceScorer:
    """Scores by the list with space features."""

    unary = "space"

    def __init__(
        self,
        model: SpaceModel,
        spaces: MapSpaces,
        layout: GridLayout,
        n_own: int,
        n_labels: int,
        dtype: DTypeLike = np.float64,
        *,
        with_halls: bool = False,
    ) -> None:
        used = model.classifier.used_features
        # In this order: what finding the gates takes for a while is free before features are held.
        self.at_gates, self.doorway = model.nodes_at_gates(spaces, layout), model.doorway
        self.features, self.n_labels = NodeFeatures.of(spaces.features, layout.cells), n_labels
        self.columns = np.asarray(used[used < n_own], np.int64)
        self.of_spaces = np.asarray(used[used >= n_own], np.int64) - n_own
        self.part = model.classifier.restricted(used)
        self.scores = np.empty((layout.n_nodes, n_labels), dtype)
        self.corridor = model.corridor
        self.hall = np.empty(layout.n_nodes, np.float32) if with_halls else None

    def set_columns(self, columns: NDArray[np.int64]) -> None:
        """Set the columns of later blocks."""
        self.places = np.searchsorted(columns, self.columns)

    def score_block(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        """Score some nodes, with doorways weighted by gates."""

        def score(some: slice) -> None:
            self.scores[nodes[some]] = self._scores(nodes[some], values[some])

        run_parts(score, len(nodes), _CELLS_PER_TASK)

    def score_cached(self, table: CachedFeatures, nodes: NDArray[np.int64]) -> None:
        """Rescore nodes whose features or spaces changed, then apply gate weights to all."""

        def score(part: slice) -> None:
            some = nodes[part]
            self.scores[some] = self._weighed(some, self._kept(table, some))

        table.prepare(self.unary, len(self.of_spaces), self._n_classes)
        run_parts(score, len(nodes), _CELLS_PER_TASK)

    def _scores(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> NDArray[np.float64]:
        """(n, K) scores of a few nodes, on one thread; stores their probabilities of halls."""
        n_own = len(self.places)
        both = np.empty((len(nodes), n_own + len(self.of_spaces)), np.float32)
        both[:, :n_own] = values if n_own == values.shape[1] else values[:, self.places]
        self.features.write(nodes, self.of_spaces, both, n_own)
        return self._weighed(nodes, aligned_log_proba(self.part, both, self._n_classes, 1))

    def _kept(self, table: CachedFeatures, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, K) cached or new scores of a few nodes, before halls and gates."""
        spaces = np.empty((len(nodes), len(self.of_spaces)), np.float32)
        self.features.write(nodes, self.of_spaces, spaces)

        def score(some: NDArray[np.int64]) -> NDArray[np.float64]:
            both = np.hstack([table.take(nodes[some], self.columns), spaces[some]])
            return aligned_log_proba(self.part, both, self._n_classes, 1)

        return table.scores(self.unary, nodes, spaces, score)

    @property
    def _n_classes(self) -> int:
        return self.n_labels + (self.corridor is not None)

    def _weighed(self, nodes: NDArray[np.int64], found: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, K) the scores with halls added to corridors, and gate weights."""
        if self.corridor is not None:
            found, share = without_halls(found, self.corridor)
            if self.hall is not None:
                self.hall[nodes] = share
        if self.at_gates is None or self.doorway is None:
            return found
        return with_gates(found, self.at_gates.of(nodes), self.doorway)


CellList = LaserScorer | SpaceScorer


def aligned_log_proba(
    fitted: BoostedList, values: NDArray[np.float32], n_labels: int, n_threads: int | None = None
) -> NDArray[np.float64]:
    """(N, K) log z with one column per label index, also for labels that the list does not have."""
    with thread_limit(n_threads):
        return on_labels(fitted, fitted.log_histogram(values), n_labels)


def without_halls(
    log_z: NDArray[np.float64], corridor: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, K) log z with the last of K + 1 classes, halls, added to corridors; and their share.

    The share (N,) is the probability that circulation is a hall.
    """
    folded = log_z[:, :-1].copy()
    folded[:, corridor] = np.logaddexp(log_z[:, corridor], log_z[:, -1])
    return folded, np.exp(log_z[:, -1] - folded[:, corridor])


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
