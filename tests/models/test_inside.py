"""What decoders show of themselves on request, against enumeration and by its own definition."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, Potentials, decode
from pgm_places.errors import InputError
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
    info = decode(TREE, potentials_on(TREE, 0), "sum-product").info
    assert not {"pair_beliefs", "messages", "disagreement"} & set(info)


@pytest.mark.parametrize("method", ["trw-s", "icm"])
def test_decoders_with_nothing_to_show_say_so(method: str) -> None:
    with pytest.raises(InputError, match=f"'{method}' has no messages and no beliefs to look at"):
        decode(TREE, potentials_on(TREE, 0), method, inside=True)
