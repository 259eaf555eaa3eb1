"""Potentials and the score that judges every answer."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import LabelGraph, Potentials, score
from pgm_places.errors import InputError


def score_by_hand(
    graph: LabelGraph, unary: np.ndarray, tables: np.ndarray, labels: tuple[int, ...]
) -> float:
    total = sum(unary[i, k] for i, k in enumerate(labels))
    for e, (i, j) in enumerate(graph.edges):
        total += tables[e, labels[i], labels[j]]
    return float(total)


@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["shared", "per edge", "agreement"]))
def test_score_counts_every_unary_and_edge_once(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    graph = LabelGraph.from_edges(4, [(0, 1), (1, 2), (0, 3), (2, 3)])
    unary = rng.normal(size=(4, 3))
    if kind == "agreement":
        potentials = Potentials(unary, agreement=rng.normal(size=(4, 3)))
    else:
        shape = (3, 3) if kind == "shared" else (4, 3, 3)
        potentials = Potentials(unary, pairwise=rng.normal(size=shape))
    tables = potentials.edge_tables(graph)
    for labels in itertools.product(range(3), repeat=4):
        wanted = score_by_hand(graph, unary, tables, labels)
        np.testing.assert_allclose(score(graph, potentials, labels), wanted, rtol=1e-12, atol=1e-12)


def test_forbidden_labels_score_minus_infinity() -> None:
    graph = LabelGraph.from_edges(1, [])
    potentials = Potentials(np.array([[0.0, -np.inf]]))
    assert score(graph, potentials, [1]) == -np.inf


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"unary": [[0.0, np.nan]]}, "unary must hold finite numbers or -inf, got nan"),
        ({"unary": [0.0]}, "unary must have shape (N, K), got (1,)"),
        ({"unary": [[0.0, 0.0]], "pairwise": np.zeros((3, 3))}, "pairwise must have shape (2, 2)"),
        ({"unary": [[0.0]], "pairwise": [[0.0]], "agreement": [[0.0]]}, "not both"),
    ],
)
def test_bad_potentials_are_refused(arguments: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(InputError) as caught:
        Potentials(**arguments)
    assert message in str(caught.value)


def test_sizes_must_fit_the_graph() -> None:
    graph = LabelGraph.from_edges(2, [(0, 1)])
    with pytest.raises(InputError, match="unary has 3 rows but the graph has 2 nodes"):
        score(graph, Potentials(np.zeros((3, 2))), [0, 0])
    with pytest.raises(InputError, match="2 rows but the graph has 1 edges"):
        score(graph, Potentials(np.zeros((2, 2)), agreement=np.zeros((2, 2))), [0, 0])
    with pytest.raises(InputError, match="labels must hold integers from 0 to 1, got 2"):
        score(graph, Potentials(np.zeros((2, 2))), [0, 2])
