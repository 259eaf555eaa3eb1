import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.layout import MaskCells
from pgm_places.solvers.grid_relaxation import (
    BLOCK,
    BlockSizes,
    _lay_out,
    neighbour_weights,
    relax_grid,
)
from pgm_places.solvers.relaxation import NODES_PER_PART, relax_graph, starting_beliefs
from tests.on_threads import on
from tests.reference.relaxation import STEPS, relaxed_graph, relaxed_grid
from tests.refusals import refused

Raster = NDArray[np.float64]


def a_raster(
    seed: int, shape: tuple[int, int], n_labels: int, *, tables: int = 1
) -> tuple[Raster, NDArray[np.int32], NDArray[np.bool_], NDArray[np.float64], Raster]:
    """Unary, cells, walls, tables and the reference's starting raster."""
    rng = np.random.default_rng(seed)
    kind = rng.choice(3, shape, p=[0.6, 0.2, 0.2])
    if not (kind == 0).any():
        kind[0, 0] = 0
    cells = np.argwhere(kind == 0).astype(np.int32)
    p = rng.dirichlet(np.ones(n_labels), len(cells))
    r = rng.uniform(-1, 1, (tables, n_labels + 1, n_labels + 1))
    start = np.full((*shape, n_labels), np.nan)
    start[kind == 0] = p
    return np.log(p), cells, kind == 1, r, start


def at(raster: Raster, cells: NDArray[np.int32]) -> Raster:
    values: Raster = raster[cells[:, 0], cells[:, 1]]
    return values


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 6), st.integers(1, 36)),
    st.integers(1, 6),
    st.sampled_from([1, 8]),
    st.sampled_from([1.0, 0.0, 0.7]),
    st.sampled_from([0.0, 0.3]),
)
def test_grid_kernel_is_the_reference(
    seed: int, shape: tuple[int, int], k: int, tables: int, diagonal: float, damping: float
) -> None:
    unary, cells, walls, r, start = a_raster(seed, shape, k, tables=tables)
    got = relax_grid(
        unary,
        cells,
        shape,
        r,
        walls=walls,
        diagonal_weight=diagonal,
        damping=damping,
        max_iterations=3,
        tolerance=0,
    )
    want = relaxed_grid(
        start, walls, r, diagonal_weight=diagonal, damping=damping, max_iterations=3
    )
    np.testing.assert_allclose(got.beliefs, at(want, cells), rtol=0, atol=5e-6)


@pytest.mark.parametrize("tables", [1, 8])
def test_rows_in_many_parts_by_any_number_of_threads_are_the_reference(tables: int) -> None:
    shape = (7, 582)
    unary, cells, walls, r, start = a_raster(3, shape, 2, tables=tables)
    mask = np.zeros(shape, np.bool_)
    mask[cells[:, 0], cells[:, 1]] = True
    want = at(relaxed_grid(start, walls, r, max_iterations=2), cells)
    blocks = BlockSizes(cells_per_part=256, nodes_at_once=100, parts_at_once=2, parts_per_thread=1)
    options = {"walls": walls, "max_iterations": 2, "tolerance": 0, "_blocks": blocks}
    first, *others = (
        on(n, relax_grid, unary, given, shape, r, **options)
        for n, given in ((1, cells), (2, cells), (5, cells), (1, MaskCells.of(mask)))
    )
    np.testing.assert_allclose(first.beliefs, want, rtol=0, atol=5e-6)
    for other in others:
        np.testing.assert_array_equal(other.beliefs, first.beliefs)
        assert other.max_change == first.max_change
        assert other.mean_change == first.mean_change
        assert other.support == first.support
    unary[-1] = -np.inf
    wanted = f"every label at node {len(cells) - 1}"
    refused(InputError, wanted, relax_grid, unary, cells, shape, r)
    refused(InputError, wanted, starting_beliefs, unary)


def test_memory_beside_beliefs_stays_small() -> None:
    cells, r = MaskCells.of(np.ones((1200, 1200), np.bool_)), np.zeros((1, 4, 4))
    unary = np.zeros((len(cells), 3), np.float32)
    relax_grid(unary[:4], MaskCells.of(np.ones((2, 2), np.bool_)), (2, 2), r)  # what is made once
    tracemalloc.start()
    blocks = BlockSizes(nodes_at_once=20_000)
    found = on(2, relax_grid, unary, cells, (1200, 1200), r, max_iterations=1, _blocks=blocks)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < found.beliefs.nbytes + 6 * len(cells)  # the store, which is not traced, aside


def adjacency(
    cells: NDArray[np.int32], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    index = {(int(y), int(x)): i for i, (y, x) in enumerate(cells)}
    start, node, direction = [0], [], []
    for y, x in index:
        for d, (dy, dx) in enumerate(STEPS):
            if (y + dy, x + dx) in index:
                node.append(index[y + dy, x + dx])
                direction.append(d)
        start.append(len(node))
    return np.array(start), np.array(node, np.int64), np.array(direction, np.int64)


@pytest.mark.parametrize("tables", [1, 8])
def test_grid_kernel_is_the_graph_kernel_where_there_are_no_walls(tables: int) -> None:
    shape = (12, 20)
    unary, cells, _, r, _ = a_raster(7, shape, 3, tables=tables)
    start, node, direction = adjacency(cells, shape)
    on_graph = relax_graph(
        unary,
        start,
        node,
        r[:, :3, :3],
        weight=np.full(len(node), 1 / 8),
        table=direction if tables == 8 else None,
        max_iterations=6,
        tolerance=0,
    )
    on_grid = relax_grid(unary, cells, shape, r, max_iterations=6, tolerance=0)
    np.testing.assert_allclose(on_grid.beliefs, on_graph.beliefs, rtol=0, atol=5e-6)
    for ours, theirs in (
        (on_grid.max_change, on_graph.max_change),
        (on_grid.mean_change, on_graph.mean_change),
        (on_grid.support, on_graph.support),
    ):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=5e-6)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 9),
    st.integers(1, 3),
    st.sampled_from(["equal", "own"]),
    st.sampled_from([0.0, 0.3]),
)
def test_graph_kernel_is_the_reference(
    seed: int, k: int, tables: int, weights: str, damping: float
) -> None:
    rng = np.random.default_rng(seed)
    n_nodes = int(rng.integers(1, 9))
    degree = rng.integers(0, 5, n_nodes)
    start = np.concatenate([[0], np.cumsum(degree)])
    owner, node = np.repeat(np.arange(n_nodes), degree), rng.integers(0, n_nodes, start[-1])
    table = rng.integers(0, tables, len(node))
    weight = rng.uniform(0, 0.2, len(node)) if weights == "own" else np.full(len(node), 0.2)
    r = rng.uniform(-1, 1, (tables, k, k))
    beliefs = rng.dirichlet(np.ones(k), n_nodes)
    found = relax_graph(
        np.log(beliefs),
        start,
        node,
        r,
        weight=weight,
        table=table,
        damping=damping,
        max_iterations=3,
        tolerance=0,
    )
    entries = list(zip(owner.tolist(), node.tolist(), weight.tolist(), table.tolist(), strict=True))
    want = relaxed_graph(beliefs, entries, r, damping=damping, max_iterations=3)
    np.testing.assert_allclose(found.beliefs, want, rtol=0, atol=1e-12)


def test_graph_threads_give_the_same_bits() -> None:
    ring = np.arange(13 * NODES_PER_PART)  # a thread has at least four parts
    unary = np.log(np.random.default_rng(7).dirichlet(np.ones(3), len(ring)))
    start, node = np.arange(0, 2 * len(ring) + 1, 2), np.stack([ring - 1, ring + 1], axis=1)
    node, r = node.ravel() % len(ring), a_raster(7, (9, 9), 3)[3]
    first, second = (
        on(n, relax_graph, unary, start, node, r[:, :3, :3], max_iterations=4, tolerance=0)
        for n in (1, 3)
    )
    np.testing.assert_array_equal(first.beliefs, second.beliefs)


def test_too_large_a_graph_is_refused() -> None:
    text = r"fewer than 8 entries of node and beliefs \(.* multiple of four\), got 2 and 8$"
    two = np.zeros((2, 3)), [0, 1, 2], [1, 0], np.zeros((1, 3, 3))
    refused(InputError, text, relax_graph, *two, _most_entries=8)


def test_forbidden_labels_stay_forbidden_and_the_floor_lifts_the_others() -> None:
    unary = np.array([[0.0, -50.0, -np.inf], [0.0, -1.0, -2.0]])
    p = starting_beliefs(unary, floor=1e-6)
    assert p[0, 2] == 0
    np.testing.assert_allclose(p[0, 1], 1e-6, rtol=1e-5)
    np.testing.assert_allclose(p.sum(axis=1), 1, rtol=1e-12)
    r = np.zeros((1, 4, 4))
    r[0, 2, :] = 1
    result = relax_grid(unary, [[0, 0], [0, 1]], (1, 2), r, floor=1e-6, max_iterations=30)
    assert result.beliefs[0, 2] == 0
    with pytest.raises(InputError, match="forbids every label at node 1"):
        starting_beliefs([[0.0, 0.0], [-np.inf, -np.inf]])


@pytest.mark.parametrize("k", [1, 2, 3, 5, 17])
@pytest.mark.parametrize("floor", [0.0, 1e-3])
def test_starting_beliefs_are_those_of_whole_array_arithmetic(k: int, floor: float) -> None:
    rng = np.random.default_rng(k)
    unary = rng.normal(scale=30, size=(1500, k))
    unary[:, 1:][rng.random((1500, k - 1)) < 0.2] = -np.inf
    expected = np.exp(unary - unary.max(axis=1, keepdims=True))
    expected /= expected.sum(axis=1, keepdims=True)
    if floor:
        expected[unary > -np.inf] = np.maximum(expected, floor)[unary > -np.inf]
        expected /= expected.sum(axis=1, keepdims=True)
    for part in (unary, np.asfortranarray(unary), unary[:3]):
        found = starting_beliefs(part, floor=floor)
        np.testing.assert_allclose(found, expected[: len(part)], rtol=1e-14, atol=0)


def test_a_cell_that_would_lose_all_mass_keeps_its_beliefs() -> None:
    r = np.zeros((1, 3, 3))
    r[0, :2, 2] = -1
    walls = np.ones((3, 3), np.bool_)
    walls[1, 1] = False
    result = relax_grid(np.log([[0.7, 0.3]]), [[1, 1]], (3, 3), r, walls=walls, max_iterations=5)
    np.testing.assert_allclose(result.beliefs, [[0.7, 0.3]], rtol=1e-6)
    graph = relax_graph(
        np.log([[0.7, 0.3], [0.3, 0.7]]), [0, 1, 2], [1, 0], -np.ones((1, 2, 2)), max_iterations=5
    )
    np.testing.assert_allclose(graph.beliefs, [[0.7, 0.3], [0.3, 0.7]], rtol=1e-12)


def test_a_single_label_and_no_nodes() -> None:
    one = relax_grid(np.zeros((2, 1)), [[0, 0], [1, 1]], (2, 2), np.zeros((1, 2, 2)))
    np.testing.assert_array_equal(one.beliefs, 1)
    none = relax_grid(np.zeros((0, 2)), np.zeros((0, 2), int), (3, 3), np.zeros((1, 3, 3)))
    assert none.beliefs.shape == (0, 2)
    assert none.converged
    empty = relax_graph(np.zeros((0, 2)), [0], np.zeros(0, int), np.zeros((1, 2, 2)))
    assert empty.beliefs.shape == (0, 2)


def test_it_stops_when_nothing_changes_any_more_and_tells_each_iteration() -> None:
    r = np.zeros((1, 3, 3))
    r[0, 0, 0] = r[0, 1, 1] = 0.9
    unary = np.log(np.random.default_rng(0).dirichlet([4, 1], 64))
    cells = np.argwhere(np.ones((8, 8), np.bool_))
    seen = []
    result = relax_grid(
        unary,
        cells,
        (8, 8),
        r,
        max_iterations=2000,
        tolerance=1e-4,
        on_iteration=lambda n, change, beliefs: seen.append((n, change, beliefs())),
    )
    assert result.converged
    assert result.max_change[-1] <= 1e-4 < result.max_change[-2]
    assert [n for n, _, _ in seen] == list(range(1, result.iterations + 1))
    assert [change for _, change, _ in seen] == result.max_change
    np.testing.assert_array_equal(seen[-1][2], result.beliefs)
    assert result.support[-1] > result.support[0]
    stopped = relax_grid(unary, cells, (8, 8), r, max_iterations=3, tolerance=1e-4)
    assert not stopped.converged
    assert stopped.iterations == 3


def test_far_apart_parts_cost_only_their_own_store() -> None:
    cells = np.array([[0, 0], [9_999, 9_999]])
    rows = _lay_out(cells.astype(np.int32), (10_000, 10_000), 100)
    assert rows.n_cells <= 2 * 9 * BLOCK


def test_neighbours_count_alike_by_default() -> None:
    unary, cells, _, r, _ = a_raster(7, (4, 5), 3)
    start, node, _ = adjacency(cells, (4, 5))
    degree = np.diff(start)
    default, given = (
        relax_graph(unary, start, node, r[:, :3, :3], weight=weight, max_iterations=2, tolerance=0)
        for weight in (None, np.repeat(1 / degree, degree))
    )
    np.testing.assert_array_equal(default.beliefs, given.beliefs)


def test_weights_sum_to_one() -> None:
    assert neighbour_weights(1.0) == (0.125, 0.125)
    assert neighbour_weights(0.0) == (0.25, 0.0)
    side, corner = neighbour_weights(0.4)
    assert 4 * side + 4 * corner == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"damping": 1.0}, "damping"),
        ({"max_iterations": -1}, "max_iterations"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"diagonal_weight": -1.0}, "diagonal_weight"),
        ({"compatibility": np.full((1, 3, 3), 2.0)}, "from -1 to 1"),
        ({"compatibility": np.zeros((2, 3, 3))}, "1 or 8 tables"),
        ({"compatibility": np.zeros((1, 2, 2))}, "compatibility must have shape"),
        ({"cells_rc": [[0, 3]]}, "cells_rc"),
        ({"cells_rc": [[0, 0], [0, 1]]}, "cells_rc"),
        (
            {"cells_rc": MaskCells.of(np.ones((1, 1), np.bool_))},
            r"cells of a mask of shape \(1, 3\), got",
        ),
        ({"walls": np.zeros((2, 2), np.bool_)}, "walls"),
        ({"unary": [[np.nan, 0.0]]}, "unary"),
    ],
)
def test_bad_options(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"unary": [[0.0, 0.0]], "cells_rc": [[0, 0]], "shape": (1, 3)}
    given |= {"compatibility": np.zeros((1, 3, 3))}
    refused(InputError, message, relax_grid, **given | change)


@pytest.mark.parametrize(
    ("start", "options", "message"),
    [
        ([0, 2, 1], {}, "start must rise"),
        ([0, 1, 2], {"weight": [1.5, 0.5]}, "sum to at most 1"),
        ([0, 1, 2], {"table": [0, 1]}, "table must hold integers"),
    ],
)
def test_bad_graphs(start: list[int], options: dict[str, Any], message: str) -> None:
    unary, table = np.zeros((2, 2)), np.zeros((1, 2, 2))
    refused(InputError, message, relax_graph, unary, start, [1, 0], table, **options)
