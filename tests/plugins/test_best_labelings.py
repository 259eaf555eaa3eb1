import networkx as nx
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pgm_places_plugins.best_labelings import best_labelings

from pgm_places import LabelGraph, Potentials, score
from pgm_places.errors import InfeasibleError, InputError
from pgm_places.solvers.forest import max_marginals
from pgm_places.solvers.local_search import allowed_labels
from pgm_places.solvers.pairwise import pairwise_model
from tests.reference.energy import Model, labelings
from tests.reference.energy import score as score_by_hand
from tests.refusals import refused
from tests.strategies import ruled_models

TREES = [nx.random_labeled_tree(n, seed=n) for n in (1, 2, 4, 5, 6)]
CYCLES = [graph for graph in nx.graph_atlas_g() if 3 <= len(graph) <= 5 and graph.size() > 4][::5]


def compare(graph: "nx.Graph[int]", k: int, *, tables: bool, decoder: str = "trw-s") -> None:
    rng = np.random.default_rng(len(graph) + graph.size())
    n = len(graph)
    built = LabelGraph.from_edges(n, np.array(graph.edges).reshape(-1, 2))
    unary = rng.normal(size=(n, k))
    unary[0, 0] = -np.inf
    if tables:
        potentials = Potentials(unary, pairwise=rng.normal(size=(built.n_edges, k, k)))
    else:
        potentials = Potentials(unary, agreement=rng.random((built.n_edges, k)))
    model = Model(unary, built.edges.astype(np.int64), potentials.agreement, potentials.pairwise)
    every = sorted((score_by_hand(model, y) for y in labelings(model)), reverse=True)
    found = best_labelings(built, potentials, 7, decoder=decoder)
    assert found.exact
    wanted = [value for value in every[:7] if value > -np.inf]
    np.testing.assert_allclose(found.scores, wanted, rtol=1e-9, atol=1e-9)
    assert len({tuple(row) for row in found.labels.tolist()}) == len(wanted)
    for row, value in zip(found.labels, found.scores, strict=True):
        assert score(built, potentials, row) == pytest.approx(value)


@pytest.mark.parametrize("number", range(len(TREES)))
@pytest.mark.parametrize("tables", [False, True])
def test_they_are_those_of_all_labellings_on_trees(number: int, tables: bool) -> None:
    compare(TREES[number], 3, tables=tables)


@pytest.mark.parametrize("number", range(len(CYCLES)))
@pytest.mark.parametrize("tables", [False, True])
def test_they_are_those_of_all_labellings_with_cycles(number: int, tables: bool) -> None:
    compare(CYCLES[number], 3, tables=tables)


@pytest.fixture
def no_elimination(monkeypatch: pytest.MonkeyPatch) -> None:
    """Graphs with cycles are decoded, as if they were too dense for anything better."""
    monkeypatch.setattr("pgm_places_plugins.best_labelings.BucketTree.of", lambda *_, **__: None)


@pytest.mark.parametrize("number", range(0, len(CYCLES), 2))
@pytest.mark.usefixtures("no_elimination")
def test_they_are_those_of_all_labellings_where_cuts_are_exact(number: int) -> None:
    compare(CYCLES[number], 2, tables=False, decoder="graph-cut")


@settings(max_examples=80)
@given(ruled_models(max_nodes=5), st.integers(1, 9))
def test_rules_cycles_and_ties_are_searched_exactly(model: Model, n_best: int) -> None:
    """Potentials are quarters, so that many labellings are equally good."""
    check(model, n_best, always_exact=True)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(model=ruled_models(max_nodes=4))
@pytest.mark.usefixtures("no_elimination")
def test_where_decoders_search_rules_hold_and_what_is_called_exact_is(model: Model) -> None:
    check(model, 5, always_exact=False)


def check(model: Model, n_best: int, *, always_exact: bool) -> None:
    graph = LabelGraph.from_edges(len(model.unary), model.edges)
    potentials = Potentials(model.unary, pairwise=model.pairwise)
    every = sorted((score_by_hand(model, y) for y in labelings(model)), reverse=True)
    wanted = [value for value in every[:n_best] if value > -np.inf]
    if not wanted:
        refused(InfeasibleError, "forbid", best_labelings, graph, potentials, n_best)
        return
    found = best_labelings(graph, potentials, n_best)
    assert found.exact or not always_exact
    assert len({tuple(row) for row in found.labels.tolist()}) == len(found.labels)
    for row, value in zip(found.labels, found.scores, strict=True):
        assert value > -np.inf
        assert score_by_hand(model, tuple(row)) == pytest.approx(value)
    if found.exact:
        np.testing.assert_allclose(found.scores, wanted, rtol=0, atol=1e-9)


def test_a_triangle_whose_nodes_must_agree() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2), (0, 2)])
    unary = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.5]])
    alike = Potentials(unary, pairwise=np.where(np.eye(2) > 0, 0.0, -np.inf))
    found = best_labelings(graph, alike, 3)
    assert found.labels.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert found.scores.tolist() == [1.0, 0.5]
    assert found.exact


@pytest.mark.usefixtures("no_elimination")
def test_nothing_is_claimed_where_the_search_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    def give_up(*arguments: object) -> None:
        return allowed_labels(*arguments, max_failures=0)  # type: ignore[arg-type, return-value]

    monkeypatch.setattr("pgm_places.solvers.local_search.allowed_labels", give_up)
    unlike = np.where(np.eye(3, dtype=np.bool_), -np.inf, 0.0)
    graph = LabelGraph.from_edges(4, [(i, j) for i in range(4) for j in range(i + 1, 4)])
    found = best_labelings(graph, Potentials(np.zeros((4, 3)), pairwise=unlike), 2, decoder="icm")
    assert (found.labels.shape, found.scores.shape, found.exact) == ((0, 4), (0,), False)


def test_known_labels_hold_and_all_labellings_may_be_listed() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    potentials = Potentials.potts(np.zeros((3, 2)), 1.0)
    found = best_labelings(graph, potentials, 100, known=[1, -1, -1])
    assert found.labels.tolist()[0] == [1, 1, 1]
    assert found.scores.tolist() == [2.0, 1.0, 1.0, 0.0]
    assert (found.labels[:, 0] == 1).all()
    refused(InputError, "n_best must be at least 1, got 0", best_labelings, graph, potentials, 0)


def test_max_marginals_are_those_of_all_labellings() -> None:
    rng = np.random.default_rng(3)
    edges = np.array(nx.random_labeled_tree(5, seed=1).edges)
    unary, tables = rng.normal(size=(5, 3)), rng.normal(size=(4, 3, 3))
    model = Model(unary, edges, pairwise=tables)
    wanted = np.full((5, 3), -np.inf)
    for labels in labelings(model):
        for node, label in enumerate(labels):
            wanted[node, label] = max(wanted[node, label], score_by_hand(model, labels))
    np.testing.assert_allclose(max_marginals(pairwise_model(unary, edges, pairwise=tables)), wanted)
