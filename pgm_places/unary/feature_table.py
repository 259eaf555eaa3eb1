"""Cell features and classifier scores, cached across updates of a map."""

from collections.abc import Callable
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgm_places.floor.view import FloorScores
from pgm_places.maps.occupancy_grid import OccupancyGrid

T = TypeVar("T", bound=np.generic)


class CachedFeatures:
    """Rows of features that stay in place while maps change, with the scores that follow from them.

    A cell keeps its row for as long as its scan is the same; a list is asked again only about rows
    that have been written since, or where something beside the row has changed. A table belongs to
    one model, as it does not know what a list looks like.

    Parameters
    ----------
    columns : (C,) int
        The laser and custom columns that the table holds, ascending.

    Attributes
    ----------
    values : (R, C) float32
        More rows than cells, as a rule.
    row_of : (N,) int64
        The row of each node of the map that was looked at last.
    """

    def __init__(self, columns: NDArray[np.int64]) -> None:
        self.columns = columns
        self.values = np.empty((0, len(columns)), np.float32)
        self.row_of = np.empty(0, np.int64)
        self._written = np.zeros(0, np.int64)
        self._n_writings = 0
        self._said: dict[str, _CachedScores] = {}
        self._seen: tuple[OccupancyGrid, FloorScores] | None = None

    @classmethod
    def of_cells(cls, values: NDArray[np.float32]) -> Self:
        """Of one map: the laser and custom features (N, C) of its nodes, which are not copied."""
        table = cls(np.arange(values.shape[1]))
        table.values, table.row_of = values, np.arange(len(values))
        table._written = np.ones(len(values), np.int64)
        return table

    def for_model(self) -> Self:
        """The same rows for another model; what networks have seen is known to it, too."""
        table = type(self)(self.columns)
        table.values, table.row_of, table._written = self.values, self.row_of, self._written
        table._seen = self._seen
        return table

    @property
    def n_rows(self) -> int:
        """R."""
        return len(self.values)

    def assign(self, kept_row: NDArray[np.int64]) -> NDArray[np.int64]:
        """Give every node a row: its own (N,) from before, or a free one where that is -1.

        The nodes with free rows are returned; :meth:`write` is to follow for each of them.
        """
        is_free = np.ones(self.n_rows, np.bool_)
        is_free[kept_row[kept_row >= 0]] = False
        fresh = np.flatnonzero(kept_row < 0)
        free = np.flatnonzero(is_free)
        if len(free) < len(fresh):
            first = self.n_rows
            self._grow(max(first + len(fresh) - len(free), first + first // 4))
            free = np.append(free, np.arange(first, self.n_rows))
        self.row_of = kept_row.copy()
        self.row_of[fresh] = free[: len(fresh)]
        return fresh

    def write(self, nodes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        """The features (n, C) of some nodes."""
        rows = self.row_of[nodes]
        self.values[rows] = values
        self._n_writings += 1
        self._written[rows] = self._n_writings

    def take(self, nodes: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, F) some of the columns of nodes."""
        places = np.searchsorted(self.columns, columns)
        return self.values[self.row_of[nodes][:, np.newaxis], places]

    def prepare(self, name: str, n_beside: int, n_scores: int) -> None:
        """Make room for what the list of that name says; :meth:`scores` may then run in threads."""
        said = self._said.get(name)
        if said is None or said.kind != (n_beside, n_scores):
            said = self._said[name] = _CachedScores(n_beside, n_scores)
        said.grow(self.n_rows)

    def scores(
        self,
        name: str,
        nodes: NDArray[np.int64],
        beside: NDArray[np.float32],
        score: Callable[[NDArray[np.int64]], NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """(n, K) what a list says of nodes: ``score`` is called with the positions it is new for.

        Parameters
        ----------
        name : str
            Of the list, as it was prepared.
        nodes : (n,) int64
        beside : (n, B) float32
            What the list looks at beside the row.
        score : callable
            From positions (m,) among ``nodes`` to scores (m, K), each by its own row and what is
            beside it.
        """
        said, rows = self._said[name], self.row_of[nodes]
        stale = said.version[rows] != self._written[rows]
        stale |= (said.beside[rows] != beside).any(axis=1)
        renewed = np.flatnonzero(stale)
        if len(renewed):
            some = rows[renewed]
            said.scores[some], said.beside[some] = score(renewed), beside[renewed]
            said.version[some] = self._written[some]
        return said.scores[rows]

    def floor_of(
        self, grid: OccupancyGrid, look: Callable[[OccupancyGrid], FloorScores]
    ) -> FloorScores:
        """Floor-network scores, recomputed only if the map changed."""
        if self._seen is None or not _same(self._seen[0], grid):
            self._seen = grid, look(grid)
        return self._seen[1]

    def _grow(self, n_rows: int) -> None:
        self.values = _grown(self.values, n_rows)
        self._written = _grown(self._written, n_rows)


class _CachedScores:
    """Cached scores per row, with the row version and extra inputs they belong to."""

    def __init__(self, n_beside: int, n_scores: int) -> None:
        self.kind = (n_beside, n_scores)
        self.beside = np.empty((0, n_beside), np.float32)
        self.scores = np.empty((0, n_scores))
        self.version = np.empty(0, np.int64)

    def grow(self, n_rows: int) -> None:
        """Room for so many rows."""
        first = len(self.scores)
        if first < n_rows:
            self.beside, self.scores = _grown(self.beside, n_rows), _grown(self.scores, n_rows)
            self.version = _grown(self.version, n_rows)
            self.version[first:] = -1


def _same(one: OccupancyGrid, other: OccupancyGrid) -> bool:
    return one.resolution_m == other.resolution_m and np.array_equal(one.cells, other.cells)


def _grown(values: NDArray[T], n_rows: int) -> NDArray[T]:
    """The rows, with zeros behind them."""
    grown = np.zeros((n_rows, *values.shape[1:]), values.dtype)
    grown[: len(values)] = values
    return grown
