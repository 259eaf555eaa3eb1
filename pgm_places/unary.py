"""From scans to unary potentials: what the boosted decision list says of every cell of a map."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import sealed
from pgm_places.errors import InputError
from pgm_places.features.context import iter_window_means, window_means
from pgm_places.features.extraction import extract
from pgm_places.features.laser import LASER_FEATURES
from pgm_places.graph import LabelGraph
from pgm_places.grid import OccupancyGrid
from pgm_places.labelled_map import LabelledMap
from pgm_places.layout import GridLayout
from pgm_places.models.boosted_list import BoostedList
from pgm_places.progress import Progress, Silent, Stage
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

RAREST_FIRST = "rarest-first"
"""An order of the list that PlaceLabeler understands besides those of the list itself."""

PRIOR_WEIGHT = 0.5
"""How far z follows the frequencies of training: at 0 rare labels are found too often, at 1 seldom;
halfway kept both accuracy and balanced accuracy on buildings held out."""

__all__ = [
    "CellScores",
    "UnaryModel",
    "aligned_log_proba",
    "contiguous_blocks",
    "fit_unary",
    "fold_groups",
    "held_out_scores",
    "training_features",
    "with_explicit_order",
]


@dataclass(frozen=True, eq=False)
class CellScores:
    """What is known of each node before its neighbours are asked.

    Parameters
    ----------
    laser : (N, K) float
        Logarithm of the histogram z of the list on laser features (paper eq. 8).
    context : (N, K) float or None
        The same from the list that also sees the neighbourhood's z, where there is one.
    node_features : (N, D) float32 or None
        The features that boosting chose first, for models that learn their own unary.
    """

    laser: NDArray[np.float64]
    context: NDArray[np.float64] | None
    node_features: NDArray[np.float32] | None


@dataclass(frozen=True, eq=False)
class UnaryModel:
    """A fitted sensor-features-list chain that scores the cells of any map.

    Parameters
    ----------
    sensor : Sensor
        How scans are simulated; a model is only good for the sensor it learned with.
    classifier : BoostedList
        The list on the 321 laser features.
    n_labels : int
        K; the classifier's classes are label indices below K.
    node_columns : (D,) int
        Laser features handed on as node features.
    context_m : tuple of float
        Half-widths in metres of the windows whose mean z the second list sees; () for none.
    context_classifier : BoostedList or None
        The second list, on laser features followed by context features.
    """

    sensor: Sensor
    classifier: BoostedList
    n_labels: int
    node_columns: NDArray[np.int64]
    context_m: tuple[float, ...] = ()
    context_classifier: BoostedList | None = field(default=None, repr=False)

    def scores(
        self,
        grid: OccupancyGrid,
        graph: LabelGraph,
        *,
        with_context: bool = True,
        with_node_features: bool = True,
        n_threads: int | None = None,
        progress: Progress | None = None,
    ) -> CellScores:
        """The scores of a grid graph's nodes: scans, features and list, streamed in tiles.

        Only the features that the lists and the result need are computed. Memory beyond the result
        is bounded by the ray caster's tiles and by bands of rows, whatever the map's size.
        """
        layout = _grid_layout(graph)
        progress = progress or Silent()
        second = self.context_classifier if with_context else None
        later = np.zeros(0, np.int64) if second is None else _laser_columns(second)
        handed = self.node_columns if with_node_features else np.zeros(0, np.int64)
        needed = np.unique(np.concatenate([self.classifier.used_features, later, handed]))
        first_list = self.classifier.restricted(needed)
        laser_part = None if second is None else second.part(needed)

        n = graph.n_nodes
        laser = np.empty((n, self.n_labels))
        features = np.empty((n, len(handed)), np.float32) if with_node_features else None
        context = None if second is None else np.empty((n, self.n_labels))

        def take(nodes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
            laser[nodes] = aligned_log_proba(first_list, values, self.n_labels, n_threads)
            if features is not None:
                features[nodes] = values[:, np.searchsorted(needed, handed)]
            if context is not None and laser_part is not None:
                # The second list waits for the first one's results all around: its stumps on the
                # scans vote now, so that the scans' features need not be kept.
                votes = laser_part.scores(values, n_threads=n_threads)
                context[nodes, : len(votes)] = votes.T

        with progress.stage("scans, features and list") as stage:
            self._stream(grid, layout.mask(), needed, take, n_threads, stage)
        if second is not None and context is not None:
            with progress.stage("spatial context"):
                self._add_context(second, grid, layout, laser, context)
        return CellScores(
            sealed(laser),
            None if context is None else sealed(context),
            None if features is None else sealed(features),
        )

    def _stream(
        self,
        grid: OccupancyGrid,
        mask: NDArray[np.bool_],
        columns: NDArray[np.int64],
        take: Callable[[NDArray[np.int64], NDArray[np.float32]], None],
        n_threads: int | None,
        stage: Stage,
    ) -> None:
        """Hand the nodes and features (n, F) of block after block of scans to ``take``."""
        done, total = 0, int(np.count_nonzero(mask))
        for block in iter_cast(grid, self.sensor, mask=mask, n_threads=n_threads):
            values = extract(
                block.ranges,
                max_range_m=self.sensor.max_range_m,
                columns=columns,
                n_threads=n_threads,
            )
            take(block.nodes, values)
            done += len(block.nodes)
            stage.update(done / max(total, 1))

    def _add_context(
        self,
        second: BoostedList,
        grid: OccupancyGrid,
        layout: GridLayout,
        laser: NDArray[np.float64],
        context: NDArray[np.float64],
    ) -> None:
        """Turn ``context`` (N, K), the list's votes on laser features so far, into its log z."""
        context_part = second.part(np.arange(len(LASER_FEATURES), second.n_features))
        bands = iter_window_means(
            layout,
            lambda nodes: np.exp(laser[nodes]),
            self.n_labels,
            self.context_m,
            grid.resolution_m,
        )
        for nodes, means in bands:
            scores = context_part.scores(means)
            scores += context[nodes, : len(scores)].T
            context[nodes] = _aligned(second, second.log_histogram_of(scores), self.n_labels)


def fit_unary(
    maps: Sequence[LabelledMap],
    n_labels: int,
    *,
    sensor: Sensor,
    classifier: "DecisionListClassifier",
    n_node_features: int = 30,
    context_m: tuple[float, ...] = (),
    learn_on: str = "out-of-fold",
    n_folds: int = 5,
    max_examples_per_map: int | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
) -> tuple[UnaryModel, list[CellScores]]:
    """A unary model fitted on the labelled cells of maps, and those cells' scores to learn from.

    Parameters
    ----------
    maps : sequence of LabelledMap
        Where to learn; only free, labelled cells inside the windows are used.
    n_labels : int
        K.
    sensor, classifier
        The sensor to simulate and an unfitted list with its options.
    n_node_features : int
        How many of the features that boosting chose first are handed to structured models.
    context_m : tuple of float
        Half-widths in metres of the windows for the second list; () for none.
    learn_on : {"in-sample", "out-of-fold"}
        Whether the returned scores come from the fitted list, or from lists that did not see the
        building that a cell lies in, or its contiguous block where there is only one building.
    n_folds : int
        Folds for out-of-fold scores: so many blocks, or at most so many groups of buildings.
    max_examples_per_map : int, optional
        Train the lists on a random choice of so many cells of each map; all cells are scored.

    Returns
    -------
    UnaryModel, list of CellScores
        One CellScores per map, in the node order of its graph of labelled cells.
    """
    from sklearn.base import clone

    progress = progress or Silent()
    masks = [item.labelled_cells for item in maps]
    sizes = [int(mask.sum()) for mask in masks]
    laser_features = training_features(maps, sensor, n_threads, progress)
    truth = np.concatenate(
        [item.labels[mask] for item, mask in zip(maps, masks, strict=True)]
    ).astype(np.int64)
    groups = building_folds(maps, masks, n_folds)
    chosen = _chosen(sizes, max_examples_per_map)

    classifier = with_explicit_order(classifier, truth)
    with progress.stage("decision list"):
        fitted = _fitted(classifier, laser_features, truth, groups, chosen)
    node_columns = np.asarray(fitted.features_in_order_of_choice(n_node_features), np.int64)
    in_sample = aligned_log_proba(fitted.boosted_list_, laser_features, n_labels, n_threads)
    held_out = None
    if context_m or learn_on == "out-of-fold":
        held_out = held_out_scores(
            fitted, laser_features, truth, groups, n_labels, progress, "held-out scores", chosen
        )
    learn_from = in_sample if learn_on == "in-sample" or held_out is None else held_out

    second, context_scores = None, None
    if context_m and held_out is not None:
        means = _context_means(maps, masks, np.exp(held_out), context_m)
        both = np.concatenate([laser_features, means], axis=1)
        with progress.stage("decision list with context"):
            same_order = clone(classifier).set_params(order=fitted.order_)
            second = _fitted(same_order, both, truth, groups, chosen)
        context_scores = (
            aligned_log_proba(second.boosted_list_, both, n_labels, n_threads)
            if learn_on == "in-sample"
            else held_out_scores(
                second, both, truth, groups, n_labels, progress, "held-out context", chosen
            )
        )
    model = UnaryModel(
        sensor,
        fitted.boosted_list_,
        n_labels,
        node_columns,
        context_m,
        None if second is None else second.boosted_list_,
    )
    nodes = laser_features[:, node_columns]
    ends = np.cumsum(sizes)[:-1]
    return model, [
        CellScores(laser, context, features)
        for laser, context, features in zip(
            np.split(learn_from, ends),
            [None] * len(maps) if context_scores is None else np.split(context_scores, ends),
            np.split(nodes, ends),
            strict=True,
        )
    ]


def with_explicit_order(
    classifier: "DecisionListClassifier", truth: NDArray[np.int64]
) -> "DecisionListClassifier":
    """The list with ``"rarest-first"`` written out as the labels by increasing frequency.

    Asked first, a rare label is separated from everything by one classifier; asked last, it gets
    what the others leave. The paper's heuristic puts it last, since it is the hardest.
    """
    from sklearn.base import clone

    if not (isinstance(classifier.order, str) and classifier.order == RAREST_FIRST):
        return classifier
    labels, counts = np.unique(truth, return_counts=True)
    order = labels[np.argsort(counts, kind="stable")].tolist()
    return clone(classifier).set_params(order=order)


def contiguous_blocks(cells_rc: NDArray[Any], n_blocks: int) -> NDArray[np.int64]:
    """(N,) block number of each cell: stripes of about equal size across the longer side.

    Neighbouring cells look alike, so held-out cells must not lie among training cells; stripes
    keep them apart but for their borders.
    """
    if n_blocks < 1:
        raise InputError(f"n_blocks must be at least 1, got {n_blocks}")
    cells = np.asarray(cells_rc)
    if not len(cells):
        return np.zeros(0, np.int64)
    axis = int(np.argmax(np.ptp(cells, axis=0)))
    along = cells[:, axis]
    cuts = np.quantile(along, np.arange(1, n_blocks) / n_blocks)
    return np.searchsorted(cuts, along, side="right").astype(np.int64)


def aligned_log_proba(
    fitted: BoostedList, values: NDArray[np.float32], n_labels: int, n_threads: int | None = None
) -> NDArray[np.float64]:
    """(N, K) log z with one column per label index, also for labels the list never saw."""
    return _aligned(fitted, fitted.log_histogram(values, n_threads=n_threads), n_labels)


def _aligned(fitted: BoostedList, found: NDArray[np.float64], n_labels: int) -> NDArray[np.float64]:
    classes = np.asarray(fitted.classes, np.int64)
    if len(classes) == n_labels:
        return found
    full = np.full((len(found), n_labels), found.min(initial=0.0))
    full[:, classes] = found
    return full


def _laser_columns(fitted: BoostedList) -> NDArray[np.int64]:
    """The laser features that a list on laser and context features uses."""
    used = fitted.used_features
    return np.asarray(used[used < len(LASER_FEATURES)], np.int64)


def training_features(
    maps: Sequence[LabelledMap], sensor: Sensor, n_threads: int | None, progress: Progress
) -> NDArray[np.float32]:
    """All laser features of all labelled cells, map after map in node order."""
    total = sum(int(item.labelled_cells.sum()) for item in maps)
    features = np.empty((total, len(LASER_FEATURES)), np.float32)
    start = 0
    with progress.stage("scans and features") as stage:
        for item in maps:
            mask = item.labelled_cells
            for block in iter_cast(item.grid, sensor, mask=mask, n_threads=n_threads):
                values = extract(block.ranges, max_range_m=sensor.max_range_m, n_threads=n_threads)
                features[start + block.nodes] = values
                stage.update((start + int(block.nodes[-1])) / max(total, 1))
            start += int(mask.sum())
    return features


def fold_groups(masks: Sequence[NDArray[np.bool_]], n_folds: int) -> NDArray[np.int64]:
    """Block numbers of the cells of several masks, map after map."""
    return np.concatenate([contiguous_blocks(np.argwhere(mask), n_folds) for mask in masks])


def building_folds(
    maps: Sequence[LabelledMap], masks: Sequence[NDArray[np.bool_]], n_folds: int
) -> NDArray[np.int64]:
    """(N,) fold of each cell: whole buildings where there are several, else contiguous blocks.

    A list is much surer of another part of a building that it has seen than of a new building;
    what is to label new buildings must learn from scores of the latter kind.
    """
    names = [item.building or f"map {index}" for index, item in enumerate(maps)]
    buildings = list(dict.fromkeys(names))
    if len(buildings) == 1:
        return fold_groups(masks, n_folds)
    fold = [buildings.index(name) % n_folds for name in names]
    return np.repeat(fold, [int(mask.sum()) for mask in masks])


def _chosen(sizes: Sequence[int], limit: int | None) -> NDArray[np.bool_] | None:
    """(N,) the cells to train on, at most ``limit`` of each map by chance; None for all."""
    if limit is None or max(sizes) <= limit:
        return None
    rng = np.random.default_rng(0)
    return np.concatenate([rng.permutation(size) < limit for size in sizes])


def _fitted(
    classifier: "DecisionListClassifier",
    features: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64],
    chosen: NDArray[np.bool_] | None,
) -> "DecisionListClassifier":
    """The list fitted on the chosen cells."""
    from sklearn.base import clone

    some = slice(None) if chosen is None else chosen  # a slice copies nothing
    fitted: DecisionListClassifier = clone(classifier).fit(
        features[some], truth[some], groups=groups[some]
    )
    return fitted


def held_out_scores(
    fitted: "DecisionListClassifier",
    features: NDArray[np.float32],
    truth: NDArray[np.int64],
    groups: NDArray[np.int64],
    n_labels: int,
    progress: Progress,
    name: str,
    chosen: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Log z of every cell from a list of the same order that did not see the cell's group.

    The lists are trained on the cells of the mask ``chosen``, by default on all.
    """
    from sklearn.base import clone

    scores = np.empty((len(truth), n_labels))
    folds = np.unique(groups)
    with progress.stage(name) as stage:
        for count, fold in enumerate(folds, start=1):
            out = groups == fold
            seen = ~out if chosen is None else chosen & ~out
            order = [label for label in fitted.order_ if (truth[seen] == label).any()]
            if len(order) < 2:
                raise InputError(
                    "out-of-fold scores need at least two labels outside every group; "
                    "use fewer folds or learn_on='in-sample'"
                )
            part = clone(fitted).set_params(order=order).fit(features[seen], truth[seen])
            scores[out] = aligned_log_proba(part.boosted_list_, features[out], n_labels)
            stage.update(count / len(folds))
    return scores


def _context_means(
    maps: Sequence[LabelledMap],
    masks: Sequence[NDArray[np.bool_]],
    scores: NDArray[np.float64],
    context_m: tuple[float, ...],
) -> NDArray[np.float32]:
    parts, start = [], 0
    for item, mask in zip(maps, masks, strict=True):
        cells = np.argwhere(mask).astype(np.int32)
        layout = GridLayout(item.grid.shape, cells)
        part = scores[start : start + len(cells)]
        parts.append(window_means(layout, part, context_m, item.grid.resolution_m))
        start += len(cells)
    return np.concatenate(parts)


def _grid_layout(graph: LabelGraph) -> GridLayout:
    if not isinstance(graph.layout, GridLayout):
        raise InputError(
            "cells can only be scored on a graph made by LabelGraph.from_grid; this one has "
            f"{'no layout' if graph.layout is None else type(graph.layout).__name__}"
        )
    return graph.layout
