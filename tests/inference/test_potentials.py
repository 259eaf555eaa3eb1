"""Potentials and the score that judges every answer."""

import itertools
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgm_places import LabelGraph, Potentials, score
from pgm_places.errors import InputError
from pgm_places.solvers.pairwise import pairwise_model
from tests.refusals import refused


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
    graph, flat = LabelGraph.from_edges(2, [(0, 1)]), np.zeros((2, 2))
    for message, potentials, labels in (
        ("unary has 3 rows but the graph has 2 nodes", Potentials(np.zeros((3, 2))), [0, 0]),
        ("2 rows but the graph has 1 edges", Potentials(flat, agreement=flat), [0, 0]),
        ("labels must hold integers from 0 to 1, got 2", Potentials(flat), [0, 2]),
    ):
        refused(InputError, message, score, graph, potentials, labels)
    assert score(graph, Potentials(np.where(np.eye(2), -np.inf, 0.0)), [0, 0]) == -np.inf


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("per_edge", [False, True])
def test_labels_on_a_scale_cost_their_distance_and_are_passed_on_as_such(
    power: Literal[1, 2], per_edge: bool
) -> None:
    graph, n_labels = LabelGraph.from_edges(3, [(0, 1), (1, 2), (0, 2)]), 50
    weight = np.array([0.5, 1.0, 2.0]) if per_edge else np.array(0.5)
    cap = np.array([3.0, 9.0, np.inf]) if per_edge else np.array(7.0)
    made = Potentials.by_distance(np.zeros((3, n_labels)), weight, power=power, cap=cap)
    tables = made.edge_tables(graph)
    for e, (a, b) in itertools.product(range(3), [(0, 0), (3, 4), (49, 0), (10, 30)]):
        w, c = (float(np.broadcast_to(values, 3)[e]) for values in (weight, cap))
        assert tables[e, a, b] == -min(w * abs(a - b) ** power, c)
    model = pairwise_model(made.unary, graph.edges, None, made.pairwise)
    assert model.max_terms.pairwise.ndim == 1


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"weight": -1.0}, "weight must be at least 0 and no NaN, got -1"),
        ({"weight": 1.0, "cap": np.nan}, "cap must be at least 0 and no NaN"),
        ({"weight": np.inf}, "weight must be at least 0"),
        ({"weight": 1.0, "power": 3}, "power must be 1 or 2, got 3"),
        ({"weight": np.ones((2, 2))}, r"numbers or one of each edge, got shapes \(2, 2\)"),
    ],
)
def test_distances_that_mean_nothing_are_refused(arguments: dict[str, Any], text: str) -> None:
    refused(InputError, text, Potentials.by_distance, np.zeros((2, 3)), **arguments)


def test_potts_takes_a_weight_for_each_edge() -> None:
    rng = np.random.default_rng(3)
    graph = LabelGraph.from_edges(4, [(0, 1), (1, 2), (0, 3), (2, 3)])
    unary, weight = rng.normal(size=(4, 3)), np.array([0.5, 0.0, 2.0, 1.0])
    potentials, tables = Potentials.potts(unary, weight), weight[:, None, None] * np.eye(3)
    for labels in itertools.product(range(3), repeat=4):
        wanted = score_by_hand(graph, unary, tables, labels)
        assert score(graph, potentials, labels) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    three = Potentials.potts(unary, weight[:3])
    refused(InputError, "3 rows but the graph has 4 edges", score, graph, three, [0] * 4)
    refused(InputError, "weight must have shape", Potentials.potts, unary, weight[:, None])


def test_shapes_are_shown_instead_of_numbers() -> None:
    assert repr(Potentials(np.zeros((4, 2)))) == "Potentials(unary (4, 2))"
    assert repr(Potentials.potts(np.zeros((4, 2)), np.ones(3))).endswith(", agreement (3, 2))")
