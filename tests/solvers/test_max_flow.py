from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.sparse.csgraph import maximum_flow

from pgm_places._core import spread_excess
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency
from pgm_places.solvers.graph_cut import minimum_cut
from tests.reference.energy import cut_value
from tests.refusals import refused
from tests.strategies import edge_lists, quarters

Network = tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
]


@st.composite
def networks(draw: st.DrawFn) -> Network:
    n_nodes = draw(st.integers(0, 6))
    edges = draw(edge_lists(n_nodes))
    capacity = quarters.map(lambda value: max(value, 0.0))

    def drawn(size: int) -> NDArray[np.float64]:
        return draw(arrays(np.float64, size, elements=capacity))

    return drawn(n_nodes), drawn(n_nodes), edges, drawn(len(edges)), drawn(len(edges))


def random_network(seed: int, n_nodes: int, n_edges: int) -> Network:
    rng = np.random.default_rng(seed)
    edges = rng.integers(0, n_nodes, (n_edges, 2))
    edges = edges[edges[:, 0] != edges[:, 1]]
    source, sink = rng.integers(0, 30, (2, n_nodes)) * (rng.random((2, n_nodes)) < 0.4)
    forward, backward = rng.integers(0, 12, (2, len(edges)))
    return (
        source.astype(float),
        sink.astype(float),
        edges,
        forward.astype(float),
        backward.astype(float),
    )


def arc_list(network: Network) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Tails, heads and whole capacities, the source numbered N and the sink N + 1."""
    source, sink, edges, forward, backward = network
    nodes = np.arange(len(source))
    tail = np.concatenate([nodes * 0 + len(nodes), nodes, edges[:, 0], edges[:, 1]])
    head = np.concatenate([nodes, nodes * 0 + len(nodes) + 1, edges[:, 1], edges[:, 0]])
    return tail, head, np.concatenate([source, sink, forward, backward]).astype(np.int64)


@given(networks())
def test_value_and_side_are_those_of_the_cheapest_of_all_cuts(network: Network) -> None:
    cut = minimum_cut(*network)
    sides = list(product((False, True), repeat=len(network[0])))
    values = [cut_value(*network, side) for side in sides]
    assert cut.value == min(values)
    assert cut_value(*network, tuple(cut.source_side.tolist())) == cut.value
    cheapest = [side for side, value in zip(sides, values, strict=True) if value == cut.value]
    assert cut.source_side.tolist() == np.all(cheapest, axis=0).tolist()


@pytest.mark.parametrize("one_way", [False, True])
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("n_nodes", "n_edges"), [(30, 60), (60, 600), (400, 1500)])
def test_value_is_that_of_scipy(seed: int, n_nodes: int, n_edges: int, one_way: bool) -> None:
    network = random_network(seed, n_nodes, n_edges)
    if one_way:  # few terminals and no way back: flow must be undone to reach the largest
        network[0][: n_nodes * 4 // 5] = 0.0
        network[1][n_nodes // 5 :] = 0.0
        network[4][:] = 0.0
    tail, head, capacity = arc_list(network)
    arcs = (tail.astype(np.int32), head.astype(np.int32))  # older SciPy takes no others
    graph = sp.csr_array((capacity.astype(np.int32), arcs), shape=(n_nodes + 2,) * 2)
    cut = minimum_cut(*network)
    assert cut.value == maximum_flow(graph, n_nodes, n_nodes + 1).flow_value


@pytest.mark.parametrize("seed", range(5))
def test_spread_excess_is_a_flow_of_whole_parts_that_cancels_most_of_it(seed: int) -> None:
    """What leaves a node arrives at the heads of its arcs, and no sum has to be rounded."""
    source, sink, edges, forward, backward = random_network(seed, 400, 1500)
    before = np.stack([forward, backward], axis=1).ravel()
    excess, capacity = source - sink, before.copy()
    spread_excess(400, adjacency(400, edges).arcs, excess, capacity)
    sent = (before - capacity)[::2]
    np.testing.assert_array_equal(sent, -(before - capacity)[1::2])
    assert (capacity >= 0.0).all()
    left = (source - sink).astype(np.longdouble)
    np.subtract.at(left, edges[:, 0], sent)
    np.add.at(left, edges[:, 1], sent)
    np.testing.assert_array_equal(excess, left)
    assert np.abs(excess).sum() < 0.75 * np.abs(source - sink).sum()


def test_huge_capacities_are_cut_without_spreading() -> None:
    huge = 1e308
    cut = minimum_cut([huge, 0.0], [0.0, huge], [(0, 1)], [1.0], [0.0])
    assert cut.value == 1.0
    assert cut.source_side.tolist() == [True, False]


@pytest.mark.parametrize("seed", range(3))
def test_float_capacities_are_cut_as_well_as_their_integer_multiples(seed: int) -> None:
    source, sink, edges, forward, backward = random_network(seed, 200, 800)
    whole = minimum_cut(source, sink, edges, forward, backward)
    tenth = minimum_cut(source / 10, sink / 10, edges, forward / 10, backward / 10)
    np.testing.assert_allclose(tenth.value, whole.value / 10, rtol=1e-12)


def test_parallel_edges_add_up() -> None:
    once = minimum_cut([9.0, 0.0], [0.0, 9.0], [(0, 1)], [5.0], [0.0])
    twice = minimum_cut([9.0, 0.0], [0.0, 9.0], [(0, 1), (1, 0)], [2.0, 0.0], [0.0, 3.0])
    assert twice.value == once.value == 5.0


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"source": [-1.0, 0.0]}, r"source_capacity must be at least 0, got -1.0 at index 0"),
        (
            {"sink": [0.0, np.inf]},
            r"sink_capacity must hold finite numbers, got inf at index \(1",
        ),
        ({"sink": [0.0]}, r"sink_capacity must have shape \(2,\), got \(1,\)"),
        ({"forward": [np.nan]}, r"forward must hold finite numbers, got nan"),
        ({"backward": [1.0, 2.0]}, r"backward must have shape \(1,\), got \(2,\)"),
        ({"edges": [(0, 2)]}, r"edges must hold integers from 0 to 1, got 2 at index \(0, 1\)"),
        ({"edges": [(1, 1)]}, r"edge 0 joins node 1 to itself"),
    ],
)
def test_bad_networks_are_refused(changed: dict[str, object], text: str) -> None:
    network = {
        "source": [1.0, 0.0],
        "sink": [0.0, 1.0],
        "edges": [(0, 1)],
        "forward": [1.0],
        "backward": [1.0],
    } | changed
    refused(InputError, text, minimum_cut, *network.values())


def test_more_nodes_than_are_numbered_are_refused_before_memory_is_asked_for() -> None:
    refused(InputError, "at most 2147483647 nodes are supported", adjacency, 2**31, [])
