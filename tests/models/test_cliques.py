from typing import Any

import networkx as nx
import numpy as np
import pytest

from pgm_places import LabelGraph, LabelingProblem, Potentials, Status, build
from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.models.cliques import clique_score, decode_with_cliques
from tests.reference.cliques import set_score
from tests.reference.energy import Model, labelings, score
from tests.refusals import refused

GRAPHS = [graph for graph in nx.graph_atlas_g() if 3 <= len(graph) <= 6][::23]


@pytest.mark.parametrize("form", ["agreement", "table", "tables"])
@pytest.mark.parametrize("number", range(len(GRAPHS)))
def test_decoders_agree_with_all_labellings(number: int, form: str) -> None:
    rng = np.random.default_rng(number)
    graph = GRAPHS[number]
    n, k, e = len(graph), 2 + number % 2, graph.size()
    weight, dissent = float(rng.uniform(0.1, 1.0)), float(rng.uniform(0.2, 1.0))
    sets = [sorted(rng.choice(n, rng.integers(2, n + 1), replace=False).tolist()) for _ in "ab"]
    given: dict[str, Any] = {
        "agreement": {"agreement": rng.random((e, k))},
        "table": {"pairwise": rng.random() * np.eye(k)},
        "tables": {"pairwise": rng.normal(size=(e, k, k))},
    }[form]
    built = LabelGraph.from_edges(n, np.array(graph.edges).reshape(-1, 2))
    unary = rng.normal(size=(n, k))
    model = Model(unary, built.edges.astype(np.int64), **given)

    def total(labels: tuple[int, ...]) -> float:
        return score(model, labels) + sum(set_score(s, labels, [weight] * k, dissent) for s in sets)

    best = max(total(labels) for labels in labelings(model))
    cliques = Cliques.of(sets, n)
    for decoder in ("trw-s", "lp") if form == "tables" else ("graph-cut", "trw-s", "lp"):
        found = decode_with_cliques(
            built, Potentials(unary, **given), cliques, decoder,
            weight=weight, dissent=dissent, certify=True,
        )  # fmt: skip
        assert found.score == pytest.approx(total(tuple(found.labels.tolist())))
        assert found.score is not None
        assert found.bound is not None
        assert found.bound >= best - 1e-9
        if k == 2 and decoder == "graph-cut":  # one minimum cut
            assert found.status is Status.EXACT
        if found.status is Status.EXACT:
            assert found.score == pytest.approx(best)
        elif form != "tables":
            assert found.score > best - 0.5


def test_most_labellings_of_associative_problems_are_proved_best() -> None:
    proved = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        graph = LabelGraph.from_lattice((4, 5))
        cliques = Cliques.of_segments(np.arange(20) // 5)
        found = decode_with_cliques(
            graph, Potentials.potts(rng.normal(size=(20, 3)), 0.3), cliques, certify=True,
            weight=0.3,
        )  # fmt: skip
        proved += found.status is Status.EXACT
    assert proved >= 7


def test_sets_follow_the_nodes_and_are_checked() -> None:
    cliques = Cliques.of([[0, 1], [2], [1, 3]], 4)
    kept = cliques.among(np.array([True, True, False, True]))
    assert kept.links.tolist() == [[0, 0], [1, 0], [1, 1], [2, 1]]
    with pytest.raises(InputError, match=r"cliques\[1\] must be one or more nodes, each once"):
        Cliques.of([[0], [1, 1]], 4)
    refused(InputError, r"cliques\[0\]", Cliques.of, [[4]], 4)


def test_a_problem_brings_its_sets_to_the_potts_field() -> None:
    """A whole segment overrules the node whose own evidence is wrong."""
    graph = LabelGraph.from_edges(6, np.zeros((0, 2), np.int64))
    unary = np.array([[2.0, 0.0]] * 3 + [[0.0, 2.0]] * 3)
    unary[0] = [0.0, 0.5]
    sets = Cliques.of([[0, 1, 2], [3, 4, 5]], 6)
    problem = LabelingProblem(graph, ("a", "b"), unary, cliques=sets)
    assert build("potts").infer(problem).labels.tolist() == [0, 0, 0, 1, 1, 1]
    off = build("potts", {"clique_weight": 0.0}).infer(problem)
    assert off.labels.tolist() == [1, 0, 0, 1, 1, 1]
    part = problem.subproblem(np.arange(6) != 1)
    assert part.cliques is not None
    assert part.cliques.sizes.tolist() == [2, 3]
    earned = clique_score(sets, [0] * 6, 2, weight=1.0, dissent=0.5)
    assert earned == 6.0
    beliefs = build("potts", {"inference": "mean-field"}).infer(problem).beliefs
    np.testing.assert_allclose(beliefs.sum(axis=1), 1.0)


def test_a_graph_hands_its_sets_to_its_parts_and_problems() -> None:
    sets = Cliques.of([[0, 1], [2, 3], [1]], 4)
    graph = LabelGraph.from_lattice((4,)).with_cliques(sets)
    problem = LabelingProblem(graph, ("a", "b"), np.zeros((4, 2)), clique_features=np.eye(3))
    assert problem.cliques is sets
    part = problem.subproblem(np.array([False, False, True, True]))
    assert part.graph.cliques is part.cliques is not None
    assert part.cliques.links.tolist() == [[0, 0], [1, 0]]
    assert part.clique_features is not None
    assert part.clique_features.tolist() == [[0.0, 1.0, 0.0]]
    both = LabelGraph.joined(LabelGraph.from_lattice((2,)), graph, np.zeros((0, 2), np.int64))
    assert both.cliques is not None
    assert both.cliques.members.tolist() == [2, 3, 4, 5, 3]
    assert repr(both) == "LabelGraph(6 nodes, 4 edges, 3 cliques)"


def test_features_of_sets_are_checked() -> None:
    graph, sets = LabelGraph.from_lattice((3,)), Cliques.of([[0, 1], [1, 2]], 3)

    def problem(features: Any, cliques: Any = sets) -> LabelingProblem:
        return LabelingProblem(
            graph, list("ab"), np.zeros((3, 2)), cliques=cliques, clique_features=features
        )

    wanted = r"clique_features must have shape \(2, G\), got \(1, 1\)"
    refused(InputError, wanted, problem, np.ones((1, 1)))
    refused(InputError, "must be at least 0, got -1", problem, -np.ones((2, 1)))
    refused(InputError, "clique_features need cliques", problem, np.ones((2, 1)), None)
    wanted = "must hold integers from 0 to 2, got 5"
    refused(InputError, wanted, graph.with_cliques, Cliques.of([[5]], 6))
    bare = LabelingProblem(graph, list("ab"), np.zeros((3, 2)), cliques=sets)
    wanted = "only the methods 'potts', 'amn' and 'crf' support cliques"
    refused(InputError, wanted, build("independent").infer, bare)


def test_the_description_tells_how_pure_the_sets_are() -> None:
    graph = LabelGraph.from_lattice((6,)).with_cliques(Cliques.of([[0, 1], [2, 3, 4]], 6))
    problem = LabelingProblem(graph, ("a", "b"), np.zeros((6, 2)))
    found = problem.describe([0, 0, 0, 1, -1, 1])
    assert found.n_cliques == 2
    assert found.in_cliques == pytest.approx(5 / 6)
    assert found.clique_purity == pytest.approx((1.0 + 0.5) / 2)
    assert "2 cliques with 83 % of the nodes, 75 % of their labels the same" in str(found)
    assert "2 cliques with 83 % of the nodes\n" in str(problem.describe())
