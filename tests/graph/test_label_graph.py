"""LabelGraph: constructors, checks, conversions."""

import random
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from pgm_places import EdgeKind, LabelGraph, OccupancyGrid, Potentials, score
from pgm_places.errors import InputError
from pgm_places.graph.edge_list import EdgeList
from pgm_places.graph.layout import GridLayout
from pgm_places.graph.raster_edges import RasterEdges
from tests.refusals import refused
from tests.strategies import edge_lists, varied_arrays


def neighbours_by_hand(free: np.ndarray, connectivity: int) -> set[tuple[int, int]]:
    cells = [tuple(cell) for cell in np.argwhere(free)]
    reach = 1 if connectivity == 4 else 2
    return {
        (i, j)
        for i, (r, c) in enumerate(cells)
        for j, (s, d) in enumerate(cells)
        if i < j and max(abs(r - s), abs(c - d)) == 1 and abs(r - s) + abs(c - d) <= reach
    }


masks = varied_arrays(np.bool_, st.tuples(st.integers(1, 5), st.integers(1, 5)))


@given(free=masks)
def test_grid_edge_kinds_tell_sides_from_corners(free: np.ndarray) -> None:
    graph = LabelGraph.from_grid(free)
    assert isinstance(graph.layout, GridLayout)
    assert graph.edge_kind is not None
    step = np.abs(np.diff(graph.layout.cells_rc[graph.edges], axis=1)[:, 0]).sum(axis=1)
    assert ((step == 2) == (graph.edge_kind == EdgeKind.DIAGONAL)).all()


def test_grid_knows_walls_positions_and_raster() -> None:
    grid = OccupancyGrid(
        np.array([[0, 0, 100], [-1, 0, 0]]), resolution_m=0.5, origin_xy_m=(1.0, 2.0)
    )
    graph = LabelGraph.from_grid(grid)
    assert isinstance(graph.layout, GridLayout)
    assert graph.positions_m is not None
    np.testing.assert_allclose(graph.positions_m[0], [1.25, 2.25], rtol=0, atol=1e-12)
    assert graph.layout.walls is not None
    assert graph.layout.walls.tolist() == [[False, False, True], [False, False, False]]
    raster = graph.layout.to_raster(np.arange(4), fill=-9)
    assert raster.tolist() == [[0, 1, -9], [-9, 2, 3]]
    assert graph.layout.from_raster(raster).tolist() == [0, 1, 2, 3]


def test_mask_restricts_the_nodes() -> None:
    free = np.ones((2, 3), np.bool_)
    mask = np.array([[True, True, False], [False, False, False]])
    assert LabelGraph.from_grid(free, mask=mask).edges.tolist() == [[0, 1]]


def test_trajectory_is_a_chain() -> None:
    graph = LabelGraph.from_trajectory([[0, 0, 0.1], [1, 0, 0.2], [2, 0, 0.3]])
    assert graph.is_chain
    assert graph.edges.tolist() == [[0, 1], [1, 2]]


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        ([(0, 3)], "integers from 0 to 2, got 3 at index (0, 1)"),
        ([(2, 1), (1, 1), (1, 0)], "edge 1 joins node 1 to itself"),
        ([(1, 2), (0, 1), (1, 0)], "edges 1 and 2 both join nodes 0 and 1"),
        ([(0.5, 1.0)], "edges must hold integers, got dtype float64"),
        ([(0, 1, 2)], "edges must have shape (E, 2), got (1, 3)"),
    ],
)
def test_bad_edges_are_refused(edges: list[tuple[int, ...]], message: str) -> None:
    with pytest.raises(InputError) as caught:
        LabelGraph.from_edges(3, edges)
    assert message in str(caught.value)


def test_what_does_not_fit_is_refused() -> None:
    path = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    order = path.edge_order([(1, 2), (0, 1)])
    layout = GridLayout.of_mask(np.ones((2, 2), np.bool_))

    def listed(*edges: tuple[int, int]) -> EdgeList:
        return EdgeList(np.array(edges, np.int32))

    of_sparse, square = LabelGraph.from_sparse, sparse.csr_array(np.eye(2))
    for message, call in (
        ("sorted", lambda: listed((1, 2), (0, 1))),
        ("i < j, sorted", lambda: listed((1, 0))),
        ("from 0 to 2, got 3", lambda: LabelGraph(3, listed((1, 3)))),
        ("join 4 cells but the graph has 3 nodes", lambda: LabelGraph(3, RasterEdges(layout))),
        (
            r"links must be .* got \[\(0, 1\)\]; LabelGraph.from_edges",
            lambda: LabelGraph(3, [(0, 1)]),  # type: ignore[arg-type]
        ),
        (r"one row per pair \(2\), got shape \(3,\)", lambda: order.values([1.0, 2.0, 3.0])),
        (
            r"shape \(E, K, K\) or \(K, K\), got \(2, 2, 3\)",
            lambda: order.tables(np.zeros((2, 2, 3))),
        ),
        (
            r"a tuple of sizes.* or a boolean mask.*dtype int64",
            lambda: LabelGraph.from_lattice(np.ones((3, 3), np.int64)),
        ),
        (r"shape \(N, N\), got \(2, 3\)", lambda: of_sparse(sparse.csr_array((2, 3)))),
        (r"0 on its diagonal, got 2 other values.*setdiag", lambda: of_sparse(square)),
        (r"must have shape \(3, 3\), got \(2, 2\)", lambda: path.edge_values(square)),
        (
            r"shape \(E, 2\), got \(2, 3\); transpose them",
            lambda: LabelGraph.from_edges(4, [[0, 1, 2], [1, 2, 3]]),
        ),
    ):
        refused(InputError, message, call)


@given(edge_lists(6), st.randoms(use_true_random=False))
def test_tables_and_features_follow_their_pairs(edges: np.ndarray, chance: random.Random) -> None:
    """Scores are those of the pairs as they were given, whatever their order and direction."""
    shuffled = chance.sample(edges.tolist(), len(edges))
    turned = [pair[:: chance.choice([1, -1])] for pair in shuffled]
    pairs = np.array(turned, np.int64).reshape(-1, 2)
    rng = np.random.default_rng(len(pairs))
    tables, labels = rng.normal(size=(len(pairs), 3, 3)), rng.integers(0, 3, 6)
    graph = LabelGraph.from_edges(6, pairs)
    order = graph.edge_order(pairs)
    wanted = sum(table[labels[i], labels[j]] for table, (i, j) in zip(tables, pairs, strict=True))
    potentials = Potentials(np.zeros((6, 3)), pairwise=order.tables(tables))
    assert score(graph, potentials, labels) == pytest.approx(wanted)
    one = Potentials(
        np.zeros((6, 3)), pairwise=order.tables(tables[0] if len(pairs) else np.eye(3))
    )
    wanted = sum(tables[0][labels[i], labels[j]] for i, j in pairs)
    assert score(graph, one, labels) == pytest.approx(wanted)
    ends = order.values(np.sort(pairs, axis=1))
    np.testing.assert_array_equal(ends, graph.edges)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ([(0, 1)], r"the 2 edges of the graph, each once, got 1; its edge \(1, 2\) is missing"),
        ([(2, 1), (2, 0)], r"got 2; the pair \(0, 2\) is no edge of it"),
        ([(0, 1), (1, 2), (2, 1)], "edges 1 and 2 both join nodes 1 and 2"),
        ([(0, 3)], "integers from 0 to 2, got 3"),
    ],
)
def test_pairs_of_another_graph_have_no_order(pairs: list[tuple[int, int]], message: str) -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    refused(InputError, message, graph.edge_order, pairs)


def test_networkx_round_trip() -> None:
    first = nx.Graph([("a", "b"), ("b", "c")])
    nx.set_node_attributes(first, {"a": (0, 0), "b": (1, 0), "c": (1, 1)}, "pos")
    graph = LabelGraph.from_networkx(first)
    assert graph.edges.tolist() == [[0, 1], [1, 2]]
    assert graph.node_names == ("a", "b", "c")
    assert list(graph.to_networkx().edges) == list(first.edges)
    back = LabelGraph.from_networkx(graph.to_networkx())
    assert back.edges.tolist() == graph.edges.tolist()
    assert back.positions_m is not None
    np.testing.assert_allclose(back.positions_m, [[0, 0], [1, 0], [1, 1]], rtol=0, atol=0)


def test_networkx_nodes_keep_their_names_in_the_order_that_is_wanted() -> None:
    club = nx.karate_club_graph()
    nodes = sorted(club, key=lambda node: -node)
    graph = LabelGraph.from_networkx(club, nodelist=nodes)
    assert graph.node_names == tuple(nodes)
    sides = graph.node_values(nx.get_node_attributes(club, "club"))
    assert sides.tolist() == [club.nodes[node]["club"] for node in nodes]
    met = graph.edge_values(nx.get_edge_attributes(club, "weight"))
    matrix = nx.to_scipy_sparse_array(club, nodelist=nodes)
    np.testing.assert_array_equal(met, graph.edge_values(matrix))
    for (i, j), weight in zip(graph.edges, met, strict=True):
        assert club.edges[nodes[i], nodes[j]]["weight"] == weight
    few = graph.subgraph(np.arange(34) < 3)
    assert few.node_names == (33, 32, 31)
    assert few.node_values({32: 1.0}, default=0.0).tolist() == [0.0, 1.0, 0.0]
    with pytest.raises(InputError, match="values has none for 2 nodes, the first 33; give a"):
        few.node_values({32: 1.0})
    refused(InputError, r"none for the edge \(33, 32\); give a default", few.edge_values, {})
    assert few.edge_values({(32, 33): 2.0}, default=0.5).max() == 2.0


@pytest.mark.parametrize("nodelist", [["a", "b"], ["a", "b", "b"], ["a", "b", "c", "d"]])
def test_a_nodelist_must_hold_every_node_once(nodelist: list[str]) -> None:
    with pytest.raises(InputError, match=r"nodelist must hold every node of the graph once: 3 no"):
        LabelGraph.from_networkx(nx.path_graph(["a", "b", "c"]), nodelist=nodelist)


def test_joined_renumbers_and_marks_links() -> None:
    grid = LabelGraph.from_grid(np.ones((1, 2), np.bool_))
    path = LabelGraph.from_trajectory([[0, 0], [1, 0]])
    both = LabelGraph.joined(grid, path, [(1, 0)])
    assert both.n_nodes == 4
    assert both.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert both.edge_kind is not None
    assert both.edge_kind.tolist() == [EdgeKind.AXIS, EdgeKind.LINK, EdgeKind.TIME]


@given(free=masks, data=st.data())
def test_subgraph_keeps_inner_edges(free: np.ndarray, data: st.DataObject) -> None:
    graph = LabelGraph.from_grid(free)
    keep = data.draw(varied_arrays(np.bool_, graph.n_nodes))
    part = graph.subgraph(keep)
    old = np.flatnonzero(keep)
    wanted = {(i, j) for i, j in map(tuple, graph.edges.tolist()) if keep[i] and keep[j]}
    assert {(int(old[i]), int(old[j])) for i, j in part.edges} == wanted


@given(free=masks)
def test_neighbours_mirror_the_edges(free: np.ndarray) -> None:
    graph = LabelGraph.from_grid(free)
    around = graph.neighbours
    pairs = set()
    for node in range(graph.n_nodes):
        part = slice(around.start[node], around.start[node + 1])
        for other, edge in zip(around.node[part], around.edge[part], strict=True):
            assert sorted((node, int(other))) == graph.edges[edge].tolist()
            pairs.add((min(node, int(other)), max(node, int(other))))
    assert pairs == set(map(tuple, graph.edges.tolist()))
    assert (np.diff(around.start) == graph.degree).all()


def test_arrays_are_read_only_copies() -> None:
    edges = np.array([[0, 1]], np.int32)
    graph = LabelGraph(2, EdgeList(edges))
    edges[0, 0] = 7
    assert graph.edges.tolist() == [[0, 1]]
    with pytest.raises(ValueError, match="read-only"):
        graph.edges[0, 0] = 1


def test_empty_graph() -> None:
    graph = LabelGraph.from_edges(0, [])
    assert (graph.n_nodes, graph.n_edges, graph.is_chain) == (0, 0, True)
    assert graph.neighbours.start.tolist() == [0]


def lattice_by_hand(mask: np.ndarray, diagonals: bool) -> set[tuple[int, int]]:
    cells = np.argwhere(mask)
    return {
        (i, j)
        for i in range(len(cells))
        for j in range(i + 1, len(cells))
        if np.abs(cells[i] - cells[j]).max() == 1
        and (diagonals or np.abs(cells[i] - cells[j]).sum() == 1)
    }


volumes = varied_arrays(np.bool_, st.lists(st.integers(1, 3), min_size=1, max_size=4).map(tuple))


@pytest.mark.parametrize("diagonals", [False, True])
@given(mask=volumes)
def test_lattice_joins_cells_one_step_apart(diagonals: bool, mask: np.ndarray) -> None:
    graph = LabelGraph.from_lattice(mask, diagonals=diagonals)
    assert graph.n_nodes == mask.sum()
    assert set(map(tuple, graph.edges.tolist())) == lattice_by_hand(mask, diagonals)
    assert graph.edge_kind is not None
    cells = np.argwhere(mask)
    n_axes = np.abs(cells[graph.edges[:, 0]] - cells[graph.edges[:, 1]]).sum(axis=1)
    assert ((n_axes > 1) == (graph.edge_kind == EdgeKind.DIAGONAL)).all()


def test_lattice_of_a_shape_is_the_one_of_a_full_mask() -> None:
    by_shape = LabelGraph.from_lattice((3, 4))
    assert by_shape.edges.tolist() == LabelGraph.from_lattice(np.ones((3, 4), bool)).edges.tolist()
    assert isinstance(by_shape.layout, GridLayout)
    assert LabelGraph.from_lattice((5,)).is_chain


points = varied_arrays(
    np.float64,
    st.tuples(st.integers(0, 8), st.integers(1, 3)),
    elements=st.integers(-3, 3).map(float),
)


@given(points=points, n_neighbours=st.integers(1, 4))
def test_points_are_joined_to_their_nearest(points: np.ndarray, n_neighbours: int) -> None:
    graph = LabelGraph.from_points(points, n_neighbours=n_neighbours)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    joined = np.zeros(distance.shape, bool)
    joined[graph.edges[:, 0], graph.edges[:, 1]] = True
    joined |= joined.T
    wanted = min(n_neighbours, len(points) - 1)
    for i in range(len(points)):
        others = np.delete(distance[i], i)
        # Ties may go either way; what counts is how far away the chosen ones are.
        nearest = np.sort(others)[: max(wanted, 0)]
        assert joined[i].sum() >= max(wanted, 0)
        if wanted > 0:
            assert np.sort(distance[i][joined[i]])[:wanted] == pytest.approx(nearest, abs=1e-12)


def test_points_keep_positions_of_two_or_three_dimensions() -> None:
    cube = np.random.default_rng(2).normal(size=(10, 3))
    assert LabelGraph.from_points(cube).positions_m == pytest.approx(cube)
    assert LabelGraph.from_points(np.ones((4, 5))).positions_m is None
    graph = LabelGraph.from_points(cube).to_networkx()
    assert graph.nodes[3]["pos"] == pytest.approx(tuple(cube[3]))
    with pytest.raises(InputError, match="positions_m must have 2 or 3 columns, got 4"):
        LabelGraph.from_edges(3, [], positions_m=np.ones((3, 4)))


@given(
    matrix=st.integers(0, 6).flatmap(
        lambda n: varied_arrays(np.int8, (n, n), elements=st.integers(-1, 1))
    )
)
def test_sparse_matrix_has_an_edge_where_it_is_not_zero(matrix: np.ndarray) -> None:
    np.fill_diagonal(matrix, 0)
    graph = LabelGraph.from_sparse(sparse.csr_array(matrix))
    expected = np.argwhere(np.triu((matrix != 0) | (matrix.T != 0)))
    assert graph.n_nodes == len(matrix)
    assert graph.edges.tolist() == expected.tolist()
    values = graph.edge_values(sparse.coo_array(matrix))
    one_sided = (matrix == 0) | (matrix.T == 0)
    larger = np.where(one_sided, matrix + matrix.T, np.maximum(matrix, matrix.T))
    assert values.tolist() == larger[tuple(expected.T)].tolist()


@pytest.mark.parametrize("connectivity", [4, 8])
@given(free=masks)
def test_grid_joins_neighbouring_free_cells_and_counts_them_unlisted(
    connectivity: int, free: np.ndarray
) -> None:
    graph, wanted = LabelGraph.from_grid(free, connectivity=connectivity), free.sum()
    by_hand = neighbours_by_hand(free, connectivity)
    assert (graph.n_nodes, graph.n_edges) == (wanted, len(by_hand))
    assert "_listed" not in vars(graph.links)
    assert set(map(tuple, graph.edges.tolist())) == by_hand
    EdgeList(graph.edges, graph.edge_kind)  # which checks their order


def test_a_part_of_a_grid_is_a_grid_with_positions() -> None:
    grid = OccupancyGrid(np.zeros((2, 3), np.int8), resolution_m=0.5)
    part = LabelGraph.from_grid(grid, connectivity=4).subgraph(np.array([1, 0, 0, 1, 1, 1]) > 0)
    assert part.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert part.positions_m is not None
    assert part.positions_m.tolist() == [[0.25, 0.25], [0.25, 0.75], [0.75, 0.75], [1.25, 0.75]]


def test_a_grid_can_be_replaced_in_part_without_listing_its_edges() -> None:
    graph = LabelGraph.from_grid(OccupancyGrid(np.zeros((2, 3), np.int8), resolution_m=0.5))
    moved = replace(graph, points_m=np.ones((6, 3)))
    assert moved.positions_m is not None
    assert moved.positions_m.shape == (6, 3)
    assert "_listed" not in vars(moved.links)
    assert moved.edges.tolist() == graph.edges.tolist()
