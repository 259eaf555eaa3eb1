"""Cell features and classifier scores, cached across updates of a map."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import row_blocks
from pgm_places.features.custom import Feature, feature_values, values_on_map
from pgm_places.floor.view import FloorScores
from pgm_places.maps.labelled_map import LabelledMap
from pgm_places.maps.occupancy_grid import OccupancyGrid
from pgm_places.sensing.ray_casting import iter_cast
from pgm_places.sensing.sensor import Sensor

Block = tuple[NDArray[np.int64], NDArray[np.float32]]
"""Numbers of cells, and their features (n, F)."""

# Scans whose features are in memory at a time: ten megabytes, which are reused for the next scans.
# Much larger arrays get new pages each time, which the system has to clear.
_SCANS_AT_ONCE = 8_192


def iter_features(
    grid: OccupancyGrid,
    sensor: Sensor,
    own: Sequence[Feature],
    mask: NDArray[np.bool_],
    columns: NDArray[np.int64] | None = None,
) -> Iterator[Block]:
    """Laser and custom features of the cells in a mask (H, W), numbered in row-major order."""
    # Avoid listing the cells of a huge map.
    of_cells = values_on_map(own, grid, np.argwhere(mask), columns) if own else {}
    for block in iter_cast(grid, sensor, mask=mask):
        for some in row_blocks(len(block.nodes), _SCANS_AT_ONCE):
            nodes, ranges = block.nodes[some], block.ranges[some]
            of_map = {place: rows[nodes] for place, rows in of_cells.items()}
            most = sensor.max_range_m
            yield nodes, feature_values(ranges, own, columns, max_range_m=most, from_map=of_map)


class FeatureTables(Protocol):
    """Cache of tables of laser features, by keys of their inputs.

    :class:`pgm_places.experiment.experiment.FeatureCache` stores them as files.
    """

    def key(self, item: LabelledMap, sensor: Sensor, mask: NDArray[np.bool_]) -> str:
        """The key of the table of the cells in a mask (H, W) of a map."""
        ...

    def get(self, key: str, shape: tuple[int, int]) -> NDArray[np.float32] | None:
        """The table (N, F) of a key, or None without one of this shape."""
        ...

    def check_space(self, shapes: Sequence[tuple[int, int]]) -> None:
        """Raise OutputError if there is no space for tables of these shapes."""
        ...

    def put(self, key: str, shape: tuple[int, int], blocks: Iterable[Block]) -> None:
        """Store a table, passed in blocks of rows with their indices."""
        ...


T = TypeVar("T", bound=np.generic)


class CachedFeatures:
    """Rows of features that stay in place while maps change, with cached scores of one model.

    A list rescores only rows written since, or whose additional inputs have changed. ``columns``
    (C,): laser and custom columns, ascending. ``values`` (R, C): mostly more rows than cells.
    ``row_of`` (N,): the row of each node of the last map.
    """

    def __init__(self, columns: NDArray[np.int64]) -> None:
        self.columns = columns
        self.values = np.empty((0, len(columns)), np.float32)
        self.row_of = np.empty(0, np.int64)
        self._written = np.zeros(0, np.int64)
        self._n_writings = 0
        self._scores: dict[str, _CachedScores] = {}
        self._floor: tuple[OccupancyGrid, FloorScores] | None = None

    @classmethod
    def of_cells(cls, values: NDArray[np.float32]) -> Self:
        """A table of one map, with the laser and custom features (N, C) of its nodes."""
        table = cls(np.arange(values.shape[1]))
        table.values, table.row_of = values, np.arange(len(values))
        table._written = np.ones(len(values), np.int64)
        return table

    def for_model(self) -> Self:
        """The rows for another model, together with the cached scores of networks."""
        table = type(self)(self.columns)
        table.values, table.row_of, table._written = self.values, self.row_of, self._written
        table._floor = self._floor
        return table

    @property
    def n_rows(self) -> int:
        """R, the number of rows."""
        return len(self.values)

    def assign(self, earlier_row: NDArray[np.int64]) -> NDArray[np.int64]:
        """Assign a row to every node: its previous row (N,), or a free one for -1.

        Returns the nodes with free rows, which :meth:`write` must fill.
        """
        is_free = np.ones(self.n_rows, np.bool_)
        is_free[earlier_row[earlier_row >= 0]] = False
        fresh = np.flatnonzero(earlier_row < 0)
        free = np.flatnonzero(is_free)
        if len(free) < len(fresh):
            first = self.n_rows
            n_rows = max(first + len(fresh) - len(free), first + first // 4)
            self.values, self._written = _grown(self.values, n_rows), _grown(self._written, n_rows)
            free = np.append(free, np.arange(first, self.n_rows))
        self.row_of = earlier_row.copy()
        self.row_of[fresh] = free[: len(fresh)]
        return fresh

    def write(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        """Write the features (n, C) of some nodes."""
        rows = self.row_of[nodes]
        self.values[rows] = values
        self._n_writings += 1
        self._written[rows] = self._n_writings

    def take(self, nodes: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) some columns of nodes."""
        places = np.searchsorted(self.columns, columns)
        return self.values[self.row_of[nodes][:, np.newaxis], places]

    def prepare(self, name: str, n_extra: int, n_scores: int) -> None:
        """Allocate the cache of a named list; :meth:`scores` may then run in threads."""
        cached = self._scores.get(name)
        if cached is None or cached.kind != (n_extra, n_scores):
            cached = self._scores[name] = _CachedScores(n_extra, n_scores)
        cached.grow(self.n_rows)

    def scores(
        self,
        name: str,
        nodes: NDArray[np.int64],
        extra: NDArray[np.float32],
        score: Callable[[NDArray[np.int64]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """(n, K) scores of ``nodes`` by the list ``name``, as passed to :meth:`prepare`.

        ``score``: from positions (m,) in ``nodes`` to scores (m, K), for outdated ones; each
        depends on its row and its additional inputs ``extra`` (n, B) only.
        """
        cached, rows = self._scores[name], self.row_of[nodes]
        stale = cached.version[rows] != self._written[rows]
        stale |= (cached.extra[rows] != extra).any(axis=1)
        renewed = np.flatnonzero(stale)
        if len(renewed):
            some = rows[renewed]
            cached.scores[some], cached.extra[some] = score(renewed), extra[renewed]
            cached.version[some] = self._written[some]
        return cached.scores[rows]

    def floor_of(
        self, grid: OccupancyGrid, look: Callable[[OccupancyGrid], FloorScores]
    ) -> FloorScores:
        """Floor-network scores, recomputed only if the map changed."""
        if self._floor is None or not _same(self._floor[0], grid):
            self._floor = grid, look(grid)
        return self._floor[1]


class _CachedScores:
    """Cached scores per row, with the row version and extra inputs they belong to."""

    def __init__(self, n_extra: int, n_scores: int) -> None:
        self.kind = (n_extra, n_scores)
        self.extra = np.empty((0, n_extra), np.float32)
        self.scores = np.empty((0, n_scores))
        self.version = np.empty(0, np.int64)

    def grow(self, n_rows: int) -> None:
        """Allocate a number of rows."""
        first = len(self.scores)
        if first < n_rows:
            self.extra, self.scores = _grown(self.extra, n_rows), _grown(self.scores, n_rows)
            self.version = _grown(self.version, n_rows)
            self.version[first:] = -1


def _same(one: OccupancyGrid, other: OccupancyGrid) -> bool:
    return one.resolution_m == other.resolution_m and np.array_equal(one.cells, other.cells)


def _grown(values: NDArray[T], n_rows: int) -> NDArray[T]:
    """The rows, extended with zeros."""
    grown = np.zeros((n_rows, *values.shape[1:]), values.dtype)
    grown[: len(values)] = values
    return grown
