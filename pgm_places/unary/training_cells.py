"""Training cells: the labelled cells of maps, as examples and in blocks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.errors import OutputError
from pgm_places.evaluation.folds import building_folds
from pgm_places.features.custom import Feature, n_columns
from pgm_places.graph.layout import GridLayout
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.progress import report_stage
from pgm_places.sensing.sensor import Sensor
from pgm_places.unary.feature_table import Block, FeatureTables, iter_features

_AT_ONCE = 65_536


@dataclass(frozen=True, eq=False)
class TrainingCells:
    """All labelled cells of maps, numbered map after map in node order, and which are examples.

    Features of cells outside a sample of examples are computed on demand, to save memory.
    """

    maps: tuple[LabelledMap, ...]
    sensor: Sensor  # the simulated sensor
    own: tuple[Feature, ...]  # custom features: see :mod:`pgm_places.features.custom`
    # truth, groups: (N,) label index of each cell, and the index of its fold
    truth: NDArray[np.int64]
    groups: NDArray[np.int64]
    chosen: NDArray[np.bool_]  # (N,) the examples
    features: NDArray[np.float32]  # (n, F) laser and custom features of the examples
    # cache of the features of all cells if all are needed, else of the examples
    feature_cache: FeatureTables | None = None

    @classmethod
    def of(
        cls,
        maps: Sequence[LabelledMap],
        sensor: Sensor,
        own: tuple[Feature, ...] = (),
        *,
        n_folds: int = 5,
        limit: int | None = None,
        seed: int = 0,
        wants_all: bool = False,
        feature_cache: FeatureTables | None = None,
    ) -> Self:
        """The cells of some maps, with at most ``limit`` examples of each, drawn by the seed.

        ``wants_all`` announces a call of :meth:`blocks`, so that the cache stores all cells.
        """
        masks = [item.labelled_cells for item in maps]
        truth = np.concatenate([item.labels[mask] for item, mask in zip(maps, masks, strict=True)])
        chosen = _chosen([int(mask.sum()) for mask in masks], limit, seed)
        examples = _split_mask(masks, chosen)
        cache = None if own else feature_cache
        return cls(
            tuple(maps),
            sensor,
            own,
            truth.astype(np.int64),
            building_folds(maps, masks, n_folds),
            chosen,
            training_features(maps, sensor, own, examples, masks if wants_all else examples, cache),
            cache,
        )

    @cached_property
    def sizes(self) -> list[int]:
        """Number of labelled cells of each map."""
        return [int(item.labelled_cells.sum()) for item in self.maps]

    @property
    def domain(self) -> NDArray[np.int64]:
        """(N,) the index of each cell's domain, -1 on maps without a domain."""
        names = sorted({item.domain for item in self.maps if item.domain is not None})
        number = [-1 if item.domain is None else names.index(item.domain) for item in self.maps]
        return np.repeat(number, self.sizes).astype(np.int64)

    @property
    def examples(self) -> NDArray[np.int64]:
        """(n,) indices of the examples, ascending."""
        return np.flatnonzero(self.chosen)

    def some_examples(self, limit: int, seed: int = 0) -> NDArray[np.int64]:
        """(n,) indices of at most ``limit`` examples of each map, drawn from the seed."""
        ends = np.cumsum(self.sizes)[:-1]
        sizes = [int(part.sum()) for part in np.split(self.chosen, ends)]
        return np.flatnonzero(_chosen(sizes, limit, seed))

    def layout(self, number: int) -> GridLayout:
        """The cells of one map."""
        return GridLayout.of_mask(self.maps[number].labelled_cells)

    def blocks(self) -> Iterator[Block]:
        """All cells with their features, some at a time."""
        if self.chosen.all():
            for part in row_blocks(len(self.truth), _AT_ONCE):
                yield np.arange(len(self.truth))[part], self.features[part]
            return
        first = 0
        for item, size in zip(self.maps, self.sizes, strict=True):
            mask = item.labelled_cells
            parts = _map_features(item, mask, self.sensor, self.own, self.feature_cache)
            yield from ((first + nodes, values) for nodes, values in parts)
            first += size

    def by_map(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """The rows of all cells, split by map."""
        return np.split(values, np.cumsum(self.sizes)[:-1])


def training_features(
    maps: Sequence[LabelledMap],
    sensor: Sensor,
    own: tuple[Feature, ...] = (),
    masks: Sequence[NDArray[np.bool_]] | None = None,
    stored: Sequence[NDArray[np.bool_]] | None = None,
    feature_cache: FeatureTables | None = None,
) -> NDArray[np.float32]:
    """(N, F) laser and custom features of cells, map after map in node order.

    Of all labelled cells, or the cells in ``masks`` (H, W), among those ``stored`` (H, W) in a
    cache.
    """
    masks = [item.labelled_cells for item in maps] if masks is None else masks
    if feature_cache is not None:
        pairs = zip(maps, masks if stored is None else stored, strict=True)
        feature_cache.check_space(
            [
                _shape(mask)
                for item, mask in pairs
                if _cached(item, mask, sensor, feature_cache) is None
            ]
        )
    total = sum(int(mask.sum()) for mask in masks)
    features = np.empty((total, n_columns(own)), np.float32)
    start = 0
    with report_stage("scans and features") as stage:
        for item, mask, held in zip(maps, masks, stored or masks, strict=True):
            if feature_cache is not None:
                _store(item, held, sensor, feature_cache)
            for nodes, values in _map_features(item, mask, sensor, own, feature_cache):
                features[start + nodes] = values
                stage.update((start + int(nodes[-1])) / max(total, 1))
            start += int(mask.sum())
    return features


def _map_features(
    item: LabelledMap,
    mask: NDArray[np.bool_],
    sensor: Sensor,
    own: tuple[Feature, ...],
    feature_cache: FeatureTables | None = None,
) -> Iterator[Block]:
    stored = None if feature_cache is None else _cached(item, mask, sensor, feature_cache)
    if stored is None:
        yield from iter_features(item.grid, sensor, own, mask)
        return
    held, table = stored
    rows = np.flatnonzero(mask[held])
    for part in row_blocks(len(rows), _AT_ONCE):
        yield np.arange(part.start, part.stop), table[rows[part]]


def _cached(
    item: LabelledMap, mask: NDArray[np.bool_], sensor: Sensor, cache: FeatureTables
) -> tuple[NDArray[np.bool_], NDArray[np.float32]] | None:
    """A mask (H, W) that contains this one, and the table (N, F) of its cells."""
    for hold in (item.labelled_cells, mask):
        table = cache.get(cache.key(item, sensor, hold), _shape(hold))
        if table is not None:
            return hold, table
    return None


def _store(
    item: LabelledMap, mask: NDArray[np.bool_], sensor: Sensor, cache: FeatureTables
) -> None:
    """Store the features of the cells in a mask of a map in the cache."""
    if _cached(item, mask, sensor, cache) is not None:
        return
    key, shape = cache.key(item, sensor, mask), _shape(mask)
    cache.put(key, shape, iter_features(item.grid, sensor, (), mask))
    if cache.get(key, shape) is None:
        raise OutputError(f"cannot read back the features written to {cache}; check the disk")


def _shape(mask: NDArray[np.bool_]) -> tuple[int, int]:
    return int(mask.sum()), n_columns(())


def _chosen(sizes: Sequence[int], limit: int | None, seed: int) -> NDArray[np.bool_]:
    """(N,) mask of the examples: all, or a random sample of at most ``limit`` of each map."""
    if limit is None or max(sizes) <= limit:
        return np.ones(sum(sizes), np.bool_)
    # A generator per map: the drawn, and cached, cells do not depend on the other maps.
    return np.concatenate([np.random.default_rng(seed).permutation(n) < limit for n in sizes])


def _split_mask(
    masks: Sequence[NDArray[np.bool_]], chosen: NDArray[np.bool_]
) -> list[NDArray[np.bool_]]:
    """The selected cells as a mask of each map."""
    parts = np.split(chosen, np.cumsum([int(mask.sum()) for mask in masks])[:-1])
    split = []
    for mask, part in zip(masks, parts, strict=True):
        examples = np.zeros(mask.shape, np.bool_)
        examples[mask] = part
        split.append(examples)
    return split
