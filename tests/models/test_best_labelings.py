import networkx as nx
import numpy as np
import pytest

from pgm_places import LabelGraph
from pgm_places.errors import InputError
from pgm_places.inference.potentials import Potentials, score
from pgm_places.models.best_labelings import best_labelings
from pgm_places.solvers.max_marginals import max_marginals
from tests.reference.energy import Model, labelings
from tests.reference.energy import score as score_by_hand

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
    found = best_labelings(built, potentials, 7, decoder=decoder)  # type: ignore[arg-type]
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
def test_they_are_those_of_all_labellings_where_cuts_are_exact(number: int) -> None:
    compare(CYCLES[number], 2, tables=False, decoder="graph-cut")


def test_known_labels_hold_and_all_labellings_may_be_listed() -> None:
    graph = LabelGraph.from_edges(3, [(0, 1), (1, 2)])
    potentials = Potentials.potts(np.zeros((3, 2)), 1.0)
    found = best_labelings(graph, potentials, 100, known=[1, -1, -1])
    assert found.labels.tolist()[0] == [1, 1, 1]
    assert found.scores.tolist() == [2.0, 1.0, 1.0, 0.0]
    assert (found.labels[:, 0] == 1).all()
    with pytest.raises(InputError, match="n_best must be at least 1, got 0"):
        best_labelings(graph, potentials, 0)


def test_max_marginals_are_those_of_all_labellings() -> None:
    rng = np.random.default_rng(3)
    edges = np.array(nx.random_labeled_tree(5, seed=1).edges)
    unary, tables = rng.normal(size=(5, 3)), rng.normal(size=(4, 3, 3))
    model = Model(unary, edges, pairwise=tables)
    wanted = np.full((5, 3), -np.inf)
    for labels in labelings(model):
        for node, label in enumerate(labels):
            wanted[node, label] = max(wanted[node, label], score_by_hand(model, labels))
    np.testing.assert_allclose(max_marginals(unary, edges, pairwise=tables), wanted)
