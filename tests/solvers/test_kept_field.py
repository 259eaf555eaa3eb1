"""A kept mean field: the same bits as one that is solved from the beginning, for less work."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.solvers import kept_field as module
from pgm_places.solvers.grid_mean_field import GridMeanField, grid_mean_field
from pgm_places.solvers.kept_field import KeptField, kept_in
from tests.on_threads import on


def assert_same(found: GridMeanField, expected: GridMeanField) -> None:
    assert found.beliefs.tobytes() == expected.beliefs.tobytes()
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.history, expected.history)
    assert found.converged == expected.converged


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([4, 8]),
    st.sampled_from([0.0, 0.4]),
    st.sampled_from([0.0, 1e-2]),
)
def test_a_change_gives_the_bits_of_a_solution_from_the_beginning(
    seed: int, connectivity: int, damping: float, tolerance: float
) -> None:
    rng = np.random.default_rng(seed)
    cells = np.argwhere(rng.random(rng.integers(1, 30, 2)) < 0.8)
    unary = np.log(rng.dirichlet(np.ones(3), len(cells)))
    table = 0.3 * np.eye(3) + 0.05 * rng.normal(size=(3, 3))
    if rng.random() < 0.3:
        table[0, 1] = -np.inf
    field = KeptField()
    for _ in range(4):
        solved = partial(
            grid_mean_field,
            unary,
            cells,
            table,
            connectivity=connectivity,
            damping=damping,
            tolerance=tolerance,
            max_iterations=12,
        )
        with kept_in(field):
            found = solved()
        assert_same(found, solved())
        unary = unary.copy()
        some = rng.integers(0, max(len(cells), 1), rng.integers(0, 3) if len(cells) else 0)
        unary[some] = np.where(rng.random(3) < 0.5, -np.inf, 0.0) if rng.random() < 0.5 else 1.0
        unary[some, rng.integers(3)] = 2.0
        if rng.random() < 0.2:  # nothing that was kept holds any more
            table = table + 0.1


def long_corridor(n_rows: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    rng = np.random.default_rng(1)
    cells = np.argwhere(np.ones((n_rows, 12), np.bool_))
    return np.log(rng.dirichlet(np.ones(3), len(cells))), cells


def test_only_rows_that_a_change_reaches_are_updated() -> None:
    unary, cells = long_corridor(400)
    field = KeptField()
    with kept_in(field):
        first = grid_mean_field(unary, cells, 0.25 * np.eye(3), max_iterations=20)
        assert field.n_updated == 400 * len(first.history)
        grid_mean_field(unary, cells, 0.25 * np.eye(3), max_iterations=20)
        assert field.n_updated == 0
        unary[:12] = 9.0, 0.0, 0.0
        grid_mean_field(unary, cells, 0.25 * np.eye(3), max_iterations=20)
    assert 0 < field.n_updated <= 20 * (2 * 20 + 1)


def test_work_that_was_broken_off_is_not_built_on() -> None:
    unary, cells = long_corridor(30)

    def stop(number: int, _: float) -> None:
        if number == 2:
            raise KeyboardInterrupt

    field = KeptField()
    with kept_in(field):
        grid_mean_field(unary, cells, 0.25 * np.eye(3))
        unary[:24] = 0.0, 5.0, 0.0
        with pytest.raises(KeyboardInterrupt):
            grid_mean_field(unary, cells, 0.25 * np.eye(3), on_iteration=stop)
        found = grid_mean_field(unary, cells, 0.25 * np.eye(3))
    assert_same(found, grid_mean_field(unary, cells, 0.25 * np.eye(3)))


def test_any_number_of_threads_gives_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pgm_places.solvers.grid_mean_field._NODES_PER_TASK", 100)
    monkeypatch.setattr(module, "_ROWS_PER_TASK", 3)
    unary, cells = long_corridor(60)
    found = []
    for n_threads in (1, 4):
        with kept_in(KeptField()):
            found.append(on(n_threads, grid_mean_field, unary, cells, np.eye(3)))
    assert_same(*found)


def test_passes_of_a_huge_field_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    unary, cells = long_corridor(20)
    monkeypatch.setattr(module, "MAX_BYTES", 1000)
    field = KeptField()
    with kept_in(field):
        grid_mean_field(unary, cells, np.eye(3))
    assert field.n_updated == 0
