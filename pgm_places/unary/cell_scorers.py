"""Scorers of the cells of one map, fed block by block with streamed features."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pgm_places._checks import require_shape
from pgm_places.graph.layout import GridLayout
from pgm_places.kernels.threads import run_parts, thread_limit
from pgm_places.models.boosted_list import BoostedList
from pgm_places.spaces.cell_features import NodeFeatures
from pgm_places.unary.feature_table import CachedFeatures
from pgm_places.unary.space_model import MapSpaces, SpaceModel, with_gates

ROWS_AT_ONCE = 128

Values = Callable[[slice], NDArray[np.float64]]
"""(n, K) values of a range of nodes."""


def window_means(
    layout: GridLayout,
    values: NDArray[np.float64],
    half_widths_m: Sequence[float],
    resolution_m: float,
) -> NDArray[np.float32]:
    """(N, W * K) means of the nodes' ``values`` (N, K) over square windows around each node.

    ``half_widths_m``: half the side of each window, rounded to cells, at least one.
    """
    require_shape("values", values.shape, (layout.n_nodes, "K"))
    n_labels = values.shape[1]
    means = np.empty((len(values), len(half_widths_m) * n_labels), np.float32)
    parts = iter_window_means(
        layout, lambda nodes: values[nodes], n_labels, half_widths_m, resolution_m
    )
    for nodes, part in parts:
        means[nodes] = part
    return means


def iter_window_means(
    layout: GridLayout,
    values: Values,
    n_labels: int,
    half_widths_m: Sequence[float],
    resolution_m: float,
) -> Iterator[tuple[slice, NDArray[np.float32]]]:
    """:func:`window_means`, bit for bit, in bands of rows, with memory independent of the height.

    ``values`` returns (n, K) for a range of nodes, called once for each in order. Yields a range
    and its (n, W * K) means.
    """
    height, width = layout.shape
    # Wider windows than the map give the same means: there is nothing to average beyond it.
    widest = max(height, width)
    radii = [max(1, round(min(half / resolution_m, widest))) for half in half_widths_m]
    first_of_row = layout.cells.row_start
    sums = _RollingIntegral(1 + n_labels, width)
    for bottom in range(0, height, ROWS_AT_ONCE):
        top = min(bottom + ROWS_AT_ONCE, height)
        nodes = slice(int(first_of_row[bottom]), int(first_of_row[top]))
        sums.forget_below(bottom - max(radii, default=0))
        ahead = min(top + max(radii, default=0), height)
        if sums.n_rows < ahead:
            new = slice(int(first_of_row[sums.n_rows]), int(first_of_row[ahead]))
            raster = np.zeros((1 + n_labels, ahead - sums.n_rows, width))
            rows, columns = layout.cells[new].T
            raster[0, rows - sums.n_rows, columns] = 1.0
            raster[1:, rows - sums.n_rows, columns] = values(new).T
            sums.append(raster)
        if nodes.start == nodes.stop:
            continue
        means = np.empty((nodes.stop - nodes.start, len(radii) * n_labels), np.float32)
        for w, radius in enumerate(radii):
            totals = sums.windows(layout.cells[nodes], radius, height)
            means[:, w * n_labels : (w + 1) * n_labels] = (totals[1:] / totals[0]).T
        yield nodes, means


class _RollingIntegral:
    """Integral images of several planes, restricted to the rows in use.

    Entry (r, c) sums the first r rows and c columns, added in order for any size of bands.
    """

    def __init__(self, n_planes: int, width: int) -> None:
        self.n_rows = 0
        self._first = 0
        self._below = np.zeros((n_planes, width))  # sums of the columns so far
        self._rows = np.zeros((n_planes, 1, width + 1))

    def forget_below(self, row: int) -> None:
        """Drop the rows of the integral images before ``row``."""
        drop = max(row - self._first, 0)
        self._rows, self._first = self._rows[:, drop:], self._first + drop

    def append(self, planes: NDArray[np.float64]) -> None:
        """Add the next rows (P, n, width) of the planes, which are overwritten."""
        planes[:, 0] += self._below
        np.cumsum(planes, axis=1, out=planes)
        self._below = planes[:, -1].copy()
        new = np.zeros((planes.shape[0], planes.shape[1], planes.shape[2] + 1))
        np.cumsum(planes, axis=2, out=new[:, :, 1:])
        self._rows = np.concatenate([self._rows, new], axis=1)
        self.n_rows += planes.shape[1]

    def windows(self, cells_rc: NDArray[np.int32], radius: int, height: int) -> NDArray[np.float64]:
        """(P, n) sums over the square windows around cells, cut off at the raster's edges."""
        width = self._rows.shape[2] - 1
        low = np.maximum(cells_rc - radius, 0)
        high = np.minimum(cells_rc + radius + 1, [height, width])
        bottom, top = low[:, 0] - self._first, high[:, 0] - self._first
        left, right = low[:, 1], high[:, 1]
        total: NDArray[np.float64] = (
            self._rows[:, top, right]
            - self._rows[:, bottom, right]
            - self._rows[:, top, left]
            + self._rows[:, bottom, left]
        )
        return total


# Number of cells whose laser and space columns one thread concatenates at a time.
_CELLS_PER_TASK = 1024


class LaserScorer:
    """Scores (N, K) by a list on ``columns`` (n,) of laser and custom features, block by block."""

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
        no_extra = np.empty((len(nodes), 0), np.float32)
        scores = table.scores(self.unary, nodes, no_extra, score)
        self.scores[nodes, : self.n_scores] = scores

    def _of(self, values: NDArray[np.float32]) -> NDArray[np.float64]:
        return aligned_log_proba(self.part, values, self.n_scores)


class ContextScorer(LaserScorer):
    """Votes of the list with context: on scans at once, on context once all scores are known."""

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
            self.scores[some] = self._weighed(some, self._cached(table, some))

        table.prepare(self.unary, len(self.of_spaces), self._n_classes)
        run_parts(score, len(nodes), _CELLS_PER_TASK)

    def _scores(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> NDArray[np.float64]:
        """(n, K) scores of a few nodes, on one thread; stores their probabilities of halls."""
        n_own = len(self.places)
        both = np.empty((len(nodes), n_own + len(self.of_spaces)), np.float32)
        both[:, :n_own] = values if n_own == values.shape[1] else values[:, self.places]
        self.features.write(nodes, self.of_spaces, both, n_own)
        return self._weighed(nodes, aligned_log_proba(self.part, both, self._n_classes, 1))

    def _cached(self, table: CachedFeatures, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
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

    def _weighed(self, nodes: NDArray[np.int64], log_z: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, K) the scores with halls added to corridors, and gate weights."""
        if self.corridor is not None:
            log_z, share = without_halls(log_z, self.corridor)
            if self.hall is not None:
                self.hall[nodes] = share
        if self.at_gates is None or self.doorway is None:
            return log_z
        return with_gates(log_z, self.at_gates.of(nodes), self.doorway)


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
    fitted: BoostedList, log_z: NDArray[np.float64], n_labels: int
) -> NDArray[np.float64]:
    """(N, K) log z of a list's own classes, with a column per label index."""
    classes = np.asarray(fitted.classes, np.int64)
    if len(classes) == n_labels:
        return log_z
    full = np.full((len(log_z), n_labels), log_z.min(initial=0.0))
    full[:, classes] = log_z
    return full
