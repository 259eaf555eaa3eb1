"""Cross-validation folds, by building or by contiguous parts, and a model for each fold."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import require_at_least
from pgm_places.graph.label_graph import LabelGraph
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import report_stage

M = TypeVar("M")


def cross_fit(
    folds: NDArray[np.int64],
    fit: Callable[[int], M],
    name: str = "held-out scores",
) -> dict[int, M]:
    """For each fold in ``folds`` (n,), the model that ``fit`` returns for all rows outside it.

    Examples
    --------
    >>> y, folds = np.array([1.0, 2.0, 6.0]), np.array([0, 0, 1])
    >>> means = cross_fit(folds, lambda fold: y[folds != fold].mean())
    >>> held_out_scores(means, folds, lambda mean, rows: mean - y[rows]).tolist()
    [5.0, 4.0, -4.5]
    """
    models, numbers = {}, np.unique(folds).tolist()
    with report_stage(name) as stage:
        for count, fold in enumerate(numbers, start=1):
            models[fold] = fit(fold)
            stage.update(count / len(numbers))
    return models


def held_out_scores(
    models: Mapping[int, M],
    folds: NDArray[np.int64],
    score: Callable[[M, NDArray[np.bool_] | slice], NDArray[Any]],
) -> NDArray[np.float64]:
    """(n, ...) the score of each row by the model that was fitted without its fold.

    ``score`` takes a model and the rows to score; if one model scores all rows, these are a slice,
    to avoid copies.
    """
    numbers = np.unique(folds).tolist()
    if len({id(models[fold]) for fold in numbers}) == 1:
        return np.asarray(score(models[numbers[0]], slice(None)), np.float64)
    scores = np.empty(0)
    for fold in numbers:
        rows = folds == fold
        part = score(models[fold], rows)
        if not len(scores):
            scores = np.empty((len(folds), *part.shape[1:]))
        scores[rows] = part
    return scores


def contiguous_blocks(places: ArrayLike, n_blocks: int) -> NDArray[np.int64]:
    """(N,) block number of each position: stripes of about equal size across the longer side.

    Neighbouring cells look alike, so held-out cells must not lie between training cells; stripes
    separate them except at their borders. Positions (N, D) with the same coordinate along that side
    are in the same block.
    """
    require_at_least("n_blocks", n_blocks, 1)
    positions = np.asarray(places)
    if not len(positions):
        return np.zeros(0, np.int64)
    along = positions[:, int(np.argmax(np.ptp(positions, axis=0)))]
    cuts = np.quantile(along, np.arange(1, n_blocks) / n_blocks)
    return np.searchsorted(cuts, along, side="right").astype(np.int64)


def contiguous_parts(
    graph: LabelGraph, n_parts: int, labels: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """(N,) part of each node: the :func:`contiguous_blocks` of the graph's positions.

    Without positions, the cells of a raster or the steps of a chain are used. If the neighbourhood
    of nodes is unknown and nodes are sorted by label, stripes in their order would hold out all
    nodes of a label: the nodes of each label (N,), -1 where unknown, are then divided separately,
    so that every part has its share of all labels.
    """
    if graph.points_m is None and isinstance(graph.layout, GridLayout):
        return contiguous_blocks(graph.layout.cells_rc, n_parts)
    if graph.points_m is not None:
        return contiguous_blocks(graph.points_m, n_parts)
    order = np.arange(graph.n_nodes)
    if labels is None or graph.layout is not None or graph.is_chain:
        return contiguous_blocks(order[:, None], n_parts)
    parts = np.empty(graph.n_nodes, np.int64)
    for label in np.unique(labels):
        nodes = order[labels == label]
        parts[nodes] = np.arange(len(nodes)) * n_parts // len(nodes)
    return parts


def groups_of(fold: int | None, places: NDArray[np.integer], n_folds: int) -> NDArray[np.int64]:
    """The fold of each place: of its building, or of its contiguous part."""
    if fold is None:
        return contiguous_blocks(places, n_folds)
    return np.full(len(places), fold, np.int64)


def building_folds(
    maps: Sequence[LabelledMap], masks: Sequence[NDArray[np.bool_]], n_folds: int
) -> NDArray[np.int64]:
    """(N,) fold of each cell: by building if there are several, else contiguous blocks.

    A list is much more confident in another part of a training building than in a new one; a method
    for new buildings must learn from scores on new buildings.
    """
    folds = fold_of_buildings(map_buildings(maps), n_folds)
    return np.concatenate(
        [
            groups_of(fold, np.argwhere(mask), n_folds)
            for fold, mask in zip(folds, masks, strict=True)
        ]
    )


def map_buildings(maps: Sequence[LabelledMap]) -> list[str]:
    """The building of each map; maps without a name are separate buildings."""
    return [item.building or f"map {index}" for index, item in enumerate(maps)]


def fold_of_buildings(buildings: Sequence[str | None], n_folds: int) -> list[int | None]:
    """The fold of each source by its building; None for sources to be cut into contiguous parts.

    Sources are cut if they have no named building, or if fewer than two buildings are named.

    Examples
    --------
    >>> fold_of_buildings(["a", "b", None, "a", "c"], 2)
    [0, 1, None, 0, 0]
    >>> fold_of_buildings(["a", "a", None], 2)
    [None, None, None]
    """
    named = list(dict.fromkeys(name for name in buildings if name is not None))
    if len(named) < 2:
        return [None] * len(buildings)
    return [None if name is None else named.index(name) % n_folds for name in buildings]
