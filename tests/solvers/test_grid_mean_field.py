"""Mean field on a raster against the slow reference, and against mean field on listed edges."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgm_places import LabelGraph, Potentials, decode, score
from pgm_places.errors import InputError
from pgm_places.graph.layout import GridLayout
from pgm_places.solvers import mean_field as module
from pgm_places.solvers.mean_field import grid_mean_field, mean_field
from pgm_places.solvers.pairwise import pairwise_model
from tests.on_threads import on
from tests.reference.mean_field import mean_field_in_order
from tests.refusals import refused


@settings(deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([4, 8]),
    st.sampled_from([0.0, 0.4]),
    st.integers(1, 3),
)
def test_every_belief_is_that_of_the_reference(
    seed: int, connectivity: int, damping: float, n_labels: int
) -> None:
    rng = np.random.default_rng(seed)
    cells = np.argwhere(rng.random(rng.integers(1, 6, 2)) < 0.7)
    unary = np.log(rng.dirichlet(np.ones(n_labels), len(cells)))
    table = rng.normal(size=(n_labels, n_labels))
    if n_labels > 1 and rng.random() < 0.3:
        table[0, 1] = -np.inf
    found = grid_mean_field(
        unary,
        cells,
        table,
        connectivity=connectivity,
        damping=damping,
        max_iterations=3,
        tolerance=0,
    )
    expected = mean_field_in_order(
        unary,
        [(int(row), int(column)) for row, column in cells],
        table,
        connectivity=connectivity,
        damping=damping,
        passes=len(found.history),
    )
    np.testing.assert_allclose(found.beliefs, expected.reshape(unary.shape), rtol=0, atol=1e-5)
    np.testing.assert_array_equal(found.labels, found.beliefs.argmax(axis=1))


def test_it_comes_to_rest_where_listed_edges_do() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_grid(rng.random((40, 50)) < 0.8)
    unary = np.log(rng.dirichlet([2.0, 1.0, 1.0], graph.n_nodes))
    assert isinstance(graph.layout, GridLayout)
    found = grid_mean_field(unary, graph.layout.cells_rc, 0.25 * np.eye(3), tolerance=1e-6)
    listed = mean_field(
        pairwise_model(unary, graph.edges, pairwise=0.25 * np.eye(3)), tolerance=1e-6
    )
    assert found.converged
    np.testing.assert_allclose(found.beliefs, listed.beliefs, rtol=0, atol=1e-4)


def test_any_number_of_threads_gives_the_same_bits() -> None:
    rng = np.random.default_rng(4)
    cells = np.argwhere(rng.random((300, 300)) < 0.8)
    assert len(cells) > 2 * module._NODES_PER_TASK
    unary = np.log(rng.dirichlet(np.ones(3), len(cells)))
    one, other = (on(n, grid_mean_field, unary, cells, np.eye(3)) for n in (1, 4))
    np.testing.assert_array_equal(one.beliefs, other.beliefs)
    np.testing.assert_array_equal(one.history, other.history)


def test_a_map_is_decoded_and_scored_without_listing_its_edges() -> None:
    rng = np.random.default_rng(5)
    graph = LabelGraph.from_grid(rng.random((12, 15)) < 0.7)
    potentials = Potentials.potts(np.log(rng.dirichlet(np.ones(3), graph.n_nodes)), 0.5)
    labeling = decode(graph, potentials, "mean-field")
    assert "_listed" not in vars(graph.links)
    agreement = np.full((graph.n_edges, 3), 0.5)
    by_edge = score(graph, Potentials(potentials.unary, agreement=agreement), labeling.labels)
    assert labeling.score == pytest.approx(by_edge, rel=1e-12)


@pytest.mark.parametrize("connectivity", [4, 8])
def test_pairs_of_labels_are_those_of_the_listed_edges(connectivity: int) -> None:
    rng = np.random.default_rng(6)
    graph = LabelGraph.from_grid(rng.random((9, 13)) < 0.6, connectivity=connectivity)
    labels = rng.integers(0, 3, graph.n_nodes)
    listed = LabelGraph.from_edges(graph.n_nodes, graph.edges)
    np.testing.assert_array_equal(
        graph.links.label_pairs(labels, 3), listed.links.label_pairs(labels, 3)
    )


@pytest.mark.parametrize(
    ("cells", "text"),
    [
        ([(0, 1), (0, 0)], r"go row by row and from left to right, each cell once, but node 1"),
        ([(1, 0), (0, 0)], r"node 1 at \(0, 0\) follows \(1, 0\)"),
        ([(0, 0), (0, 0)], r"node 1 at \(0, 0\) follows \(0, 0\)"),
        ([(0, 0)], r"cells_rc must have shape \(2, 2\), got \(1, 2\)"),
    ],
)
def test_cells_in_another_order_are_refused(cells: list[tuple[int, int]], text: str) -> None:
    refused(InputError, text, grid_mean_field, np.zeros((2, 3)), cells)
    none = np.array([[0.0, 0.0], [-np.inf, -np.inf]])
    wanted = "unary forbids every label at node 1"
    refused(InputError, wanted, grid_mean_field, none, [(0, 0), (0, 1)])
