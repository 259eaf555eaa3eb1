"""What decoders show of themselves on request, against enumeration and by its own definition."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, Potentials, decode
from pgm_places.errors import InputError
from pgm_places.solvers.marginal_lp import dual_bound
from tests.reference.energy import Model, pair_marginals

TREE = LabelGraph.from_edges(5, [(0, 1), (1, 2), (1, 3), (3, 4)])
RING = LabelGraph.from_edges(4, [(0, 1), (1, 2), (2, 3), (0, 3)])


def potentials_on(graph: LabelGraph, seed: int, *, barred: bool = False) -> Potentials:
    rng = np.random.default_rng(seed)
    tables = rng.normal(size=(graph.n_edges, 3, 3))
    unary = rng.normal(size=(graph.n_nodes, 3))
    if barred:
        tables[0, 1, 2] = tables[1, 0, 0] = unary[2, 1] = -np.inf
    return Potentials(unary, pairwise=tables)


def truth(graph: LabelGraph, potentials: Potentials) -> NDArray[np.float64]:
    edges = graph.edges.astype(np.int64)
    return pair_marginals(Model(potentials.unary, edges, pairwise=potentials.pairwise))


@pytest.mark.parametrize("barred", [False, True])
@pytest.mark.parametrize(
    ("method", "graph"), [("exact", TREE), ("exact", RING), ("sum-product", TREE)]
)
def test_pair_beliefs_are_the_marginals(method: str, graph: LabelGraph, barred: bool) -> None:
    potentials = potentials_on(graph, 2, barred=barred)
    found = decode(graph, potentials, method, inside=True)
    expected = truth(graph, potentials)
    np.testing.assert_allclose(found.info["pair_beliefs"], expected, rtol=0, atol=1e-12)
    differ = 1 - np.einsum("ekk->e", expected)
    np.testing.assert_allclose(found.info["disagreement"], differ, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["sum-product", "mean-field", "exact"])
def test_pair_beliefs_agree_with_those_of_nodes_on_cycles(method: str) -> None:
    found = decode(RING, potentials_on(RING, 5), method, inside=True)
    assert found.beliefs is not None
    first, second = RING.edges.T
    joint = found.info["pair_beliefs"]
    np.testing.assert_allclose(joint.sum(axis=2), found.beliefs[first], rtol=0, atol=1e-3)
    np.testing.assert_allclose(joint.sum(axis=1), found.beliefs[second], rtol=0, atol=1e-3)


@pytest.mark.parametrize("method", ["sum-product", "max-product"])
def test_messages_and_unaries_are_the_beliefs(method: str) -> None:
    potentials = potentials_on(RING, 7)
    found = decode(RING, potentials, method, inside=True)
    messages: Any = found.info["messages"]
    heard = potentials.unary.copy()
    for edge, (i, j) in enumerate(RING.edges):
        heard[j] += messages[2 * edge]
        heard[i] += messages[2 * edge + 1]
    shares = np.exp(heard - heard.max(axis=1, keepdims=True))
    shares /= shares.sum(axis=1, keepdims=True)
    if found.beliefs is not None:
        np.testing.assert_allclose(shares, found.beliefs, rtol=0, atol=1e-12)
    else:
        np.testing.assert_array_equal(shares.argmax(axis=1), found.labels)


def test_nothing_is_shown_unless_asked_for() -> None:
    for method in ("sum-product", "trw-s", "lp"):
        info = decode(TREE, potentials_on(TREE, 0), method).info
        assert not {"pair_beliefs", "messages", "disagreement", "duals"} & set(info)


@pytest.mark.parametrize("method", ["trw-s", "lp"])
@pytest.mark.parametrize("seed", range(5))
def test_duals_are_those_of_the_bound(method: str, seed: int) -> None:
    potentials = potentials_on(RING, seed)
    found = decode(RING, potentials, method, inside=True)
    arrays = potentials.unary, RING.edges, None, potentials.pairwise
    bound = dual_bound(*arrays, duals=found.info["duals"])
    assert found.bound == pytest.approx(bound, abs=1e-9)
    assert found.bound == decode(RING, potentials, method).bound


def test_graph_cuts_of_two_labels_show_their_flow() -> None:
    unary = np.random.default_rng(1).normal(size=(4, 2))
    potentials = Potentials.potts(unary, 0.4)
    found = decode(RING, potentials, "graph-cut", inside=True)
    table = potentials.pairwise
    bound = dual_bound(unary, RING.edges, None, table, duals=found.info["duals"])
    assert bound == pytest.approx(found.score, abs=1e-12)
    three = Potentials.potts(np.zeros((4, 3)), 0.4)
    with pytest.raises(InputError, match="with two labels, 'graph-cut'"):
        decode(RING, three, "graph-cut", inside=True)


def test_decoders_with_nothing_to_show_say_so() -> None:
    with pytest.raises(
        InputError, match="inside is not supported by 'icm' here: messages come from"
    ):
        decode(TREE, potentials_on(TREE, 0), "icm", inside=True)
