"""Learning the unary model: decision lists on the cells of labelled maps, and held-out scores."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.evaluation.folds import building_folds
from pgm_places.features.context import window_means
from pgm_places.features.own import feature_values, n_columns, values_on_map
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import Progress, Silent
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.map_model import CellScores, UnaryModel, aligned_log_proba

if TYPE_CHECKING:  # scikit-learn takes a second to import, and labelling does without it
    from pgm_places.models.decision_list import DecisionListClassifier

RAREST_FIRST = "rarest-first"
"""An order of the list that PlaceLabeler understands besides those of the list itself."""

__all__ = [
    "fit_unary",
    "held_out_scores",
    "training_features",
    "with_explicit_order",
]


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
    features: tuple[Any, ...] = (),
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
    features : tuple
        Features of one's own, beside the laser's: see :mod:`pgm_places.features.own`.

    Returns
    -------
    UnaryModel, list of CellScores
        One CellScores per map, in the node order of its graph of labelled cells.
    """
    from sklearn.base import clone

    progress = progress or Silent()
    masks = [item.labelled_cells for item in maps]
    sizes = [int(mask.sum()) for mask in masks]
    laser_features = training_features(maps, sensor, n_threads, progress, features)
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
            # Stumps: their votes on scans and on context can be cast apart, those of trees cannot.
            same_order = clone(classifier).set_params(
                order=fitted.order_, max_depth=1, shrinkage=1.0
            )
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
        features,
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


def training_features(
    maps: Sequence[LabelledMap],
    sensor: Sensor,
    n_threads: int | None,
    progress: Progress,
    own: tuple[Any, ...] = (),
) -> NDArray[np.float32]:
    """All laser and own features of all labelled cells, map after map in node order."""
    total = sum(int(item.labelled_cells.sum()) for item in maps)
    features = np.empty((total, n_columns(own)), np.float32)
    start = 0
    with progress.stage("scans and features") as stage:
        for item in maps:
            mask = item.labelled_cells
            of_cells = values_on_map(own, item.grid, np.argwhere(mask))
            for block in iter_cast(item.grid, sensor, mask=mask, n_threads=n_threads):
                values = feature_values(
                    block.ranges,
                    own,
                    max_range_m=sensor.max_range_m,
                    from_map={place: rows[block.nodes] for place, rows in of_cells.items()},
                    n_threads=n_threads,
                )
                features[start + block.nodes] = values
                stage.update((start + int(block.nodes[-1])) / max(total, 1))
            start += int(mask.sum())
    return features


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
