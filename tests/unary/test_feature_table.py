"""A table that keeps what lists have said tells what they would say now."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.unary.feature_table import CachedFeatures

COLUMNS = np.array([2, 5, 9])


def said(values: NDArray[np.float32], beside: NDArray[np.float32]) -> NDArray[np.float64]:
    """A list of two scores."""
    both = np.hstack([values, beside]).astype(np.float64)
    return np.stack([both.sum(axis=1), both[:, 0] - both[:, -1]], axis=1)


class Maps:
    """Cells that come, change and go, with their features kept by their numbers."""

    def __init__(self, seed: int) -> None:
        self.rng, self.table = np.random.default_rng(seed), CachedFeatures(COLUMNS)
        self.of_cell: dict[int, NDArray[np.float32]] = {}
        self.row: dict[int, int] = {}
        self.n_scored = 0

    def next(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """A map's cells, and the nodes whose features are new."""
        cells = np.flatnonzero(self.rng.random(40) < self.rng.uniform(0.2, 0.9))
        cells = cells if len(cells) else np.array([0])
        changed = self.rng.random(len(cells)) < 0.2
        kept = [
            -1 if c else self.row.get(cell, -1)
            for cell, c in zip(cells.tolist(), changed.tolist(), strict=True)
        ]
        fresh = self.table.assign(np.array(kept, np.int64))
        values = self.rng.integers(0, 3, (len(fresh), 3)).astype(np.float32)
        half = len(fresh) // 2
        self.table.write(fresh[:half], values[:half])
        self.table.write(fresh[half:], values[half:])
        self.of_cell |= dict(zip(cells[fresh].tolist(), values, strict=True))
        self.row = dict(zip(cells.tolist(), self.table.row_of.tolist(), strict=True))
        return cells, fresh

    def scored(self, name: str, beside: NDArray[np.float32]) -> NDArray[np.float64]:
        nodes = np.arange(len(beside))

        def score(some: NDArray[np.int64]) -> NDArray[np.float64]:
            self.n_scored += len(some)
            return said(self.table.take(nodes[some], COLUMNS), beside[some])

        self.table.prepare(name, beside.shape[1], 2)
        return self.table.scores(name, nodes, beside, score)


@pytest.mark.parametrize("seed", range(4))
def test_scores_and_features_are_those_of_now(seed: int) -> None:
    maps = Maps(seed)
    for step in range(30):
        cells, _ = maps.next()
        wanted = np.array([maps.of_cell[cell] for cell in cells.tolist()])
        nodes = np.arange(len(cells))
        np.testing.assert_array_equal(maps.table.take(nodes, COLUMNS), wanted)
        np.testing.assert_array_equal(maps.table.take(nodes, COLUMNS[1:]), wanted[:, 1:])
        assert len(set(maps.table.row_of.tolist())) == len(cells)
        beside = maps.rng.integers(0, 2, (len(cells), 1)).astype(np.float32)
        for name in ("often", "seldom")[: 1 + (step % 3 == 0)]:
            np.testing.assert_array_equal(maps.scored(name, beside), said(wanted, beside))
    assert maps.table.n_rows <= 60  # rows are used again


def test_only_what_has_changed_is_scored() -> None:
    maps = Maps(0)
    cells, _ = maps.next()
    beside = np.zeros((len(cells), 1), np.float32)
    maps.scored("list", beside)
    assert maps.n_scored == len(cells)
    maps.scored("list", beside)
    assert maps.n_scored == len(cells)
    beside[3] = 1
    maps.scored("list", beside)
    assert maps.n_scored == len(cells) + 1
    maps.table.write(np.array([5, 6]), np.ones((2, 3), np.float32))
    maps.scored("list", beside)
    assert maps.n_scored == len(cells) + 3
