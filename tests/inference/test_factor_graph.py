"""Factors of any order against brute force, with every decoder that takes them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places import LabelGraph, Potentials, Status, score
from pgm_places.errors import ConfigError, InfeasibleError, InputError
from pgm_places.inference.factor_graph import FactorGraph
from pgm_places.models.factor_decoding import PAIRWISE_ONLY, decode_factors
from tests.models.test_decoders import by_unary
from tests.refusals import refused

ANY_ORDER = ["exact", "trw-s", "lp", "max-product", "sum-product"]


def random_factors(seed: int, *, order: int = 4, unit: float = 1.0) -> FactorGraph:
    """Up to 8 nodes of 1 to 3 labels; ties every other time, and a third forbid something."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    sizes = rng.integers(1, 4, n)
    tables, scopes = [], []
    for _ in range(rng.integers(0, 8)):
        scope = tuple(rng.permutation(n)[: rng.integers(0, order + 1)].tolist())
        shape = [sizes[node] for node in scope]
        values = rng.normal(size=shape) if seed % 2 else rng.integers(-2, 3, shape) / 2
        table = unit * np.asarray(values, np.float64)
        if seed % 3 == 0 and scope:
            table[rng.random(shape) < 0.25] = -np.inf
        scopes.append(scope)
        tables.append(table)
    return FactorGraph.of(sizes, tuple(scopes), tuple(tables))


def all_labelings(graph: FactorGraph) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    every = np.indices(tuple(graph.n_labels)).reshape(graph.n_nodes, -1).T
    return every, np.array([graph.score(labels) for labels in every])


@pytest.mark.parametrize("unit", [1.0, 1e-12, 1e12])
@pytest.mark.parametrize("method", ANY_ORDER)
def test_what_is_said_of_factors_holds(method: str, unit: float) -> None:
    n_exact = 0
    for seed in range(24):
        graph = random_factors(seed, unit=unit)
        best = all_labelings(graph)[1].max()
        slack = 1e-11 * unit * (1 + len(graph.scopes))
        if best == -np.inf:
            refused(InfeasibleError, "forbid", decode_factors, graph, method)
            continue
        found = decode_factors(graph, method, certify=seed % 2 == 0)
        assert found.score == graph.score(found.labels)
        assert found.score > -np.inf
        if found.status is Status.EXACT:
            assert found.score >= best - slack
            n_exact += 1
        if found.bound is not None:
            assert found.bound >= max(best - slack, found.score)
        if found.beliefs is not None:
            assert not found.beliefs[np.arange(3) >= graph.n_labels[:, np.newaxis]].any()
    assert n_exact >= (20 if method == "exact" else 6)


@pytest.mark.parametrize("seed", range(16))
def test_beliefs_and_partition_are_those_of_all_labellings(seed: int) -> None:
    graph = random_factors(seed)
    every, scores = all_labelings(graph)
    if scores.max() == -np.inf:
        return
    found = decode_factors(graph)
    chances = np.exp(scores - scores.max())
    log_partition = scores.max() + np.log(chances.sum())
    assert found.info["log_partition"] == pytest.approx(log_partition, rel=0, abs=1e-10)
    assert found.beliefs is not None
    for node, row in enumerate(found.beliefs):
        shares = [chances[every[:, node] == k].sum() / chances.sum() for k in range(len(row))]
        np.testing.assert_allclose(row, shares, rtol=0, atol=1e-10)


def test_known_labels_are_kept() -> None:
    graph = random_factors(1)
    known = np.full(graph.n_nodes, -1)
    known[0] = graph.n_labels[0] - 1
    every, scores = all_labelings(graph)
    best = scores[every[:, 0] == known[0]].max()
    found = decode_factors(graph, known=known)
    assert found.labels[0] == known[0]
    assert found.score == pytest.approx(best, rel=0, abs=1e-12)


def test_pairwise_models_are_factor_graphs_and_back() -> None:
    rng = np.random.default_rng(0)
    ring = LabelGraph.from_edges(4, [(0, 1), (1, 2), (2, 3), (0, 3)])
    potentials = Potentials(rng.normal(size=(4, 3)), pairwise=rng.normal(size=(4, 3, 3)))
    graph = FactorGraph.of_potentials(ring, potentials)
    assert graph.order == 2
    labels = [0, 2, 1, 1]
    assert graph.score(labels) == pytest.approx(score(ring, potentials, labels), rel=1e-12)
    back, again = graph.pairwise()
    assert back.edges.tolist() == ring.edges.tolist()
    np.testing.assert_array_equal(again.unary, potentials.unary)
    np.testing.assert_array_equal(again.pairwise, potentials.pairwise)


@pytest.mark.parametrize("method", PAIRWISE_ONLY)
def test_decoders_of_pairs_refuse_more_in_one_line(method: str) -> None:
    graph = FactorGraph.of([2, 2, 2], [(0, 1, 2)], [np.zeros((2, 2, 2))])
    with pytest.raises(InputError, match="supports factors of at most two nodes, and one has 3"):
        decode_factors(graph, method)
    pairs = FactorGraph.of([2, 3], [(1, 0), (0,)], [np.zeros((3, 2)), [0.0, 1.0]])
    assert decode_factors(pairs, method).labels[0] == 1


def test_added_decoders_get_factors_as_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    from pgm_places.models.decoders import NamedDecoder

    monkeypatch.setattr("pgm_places.models.decoders._registered", {"mine": NamedDecoder(by_unary)})
    graph = random_factors(4)
    assert (decode_factors(graph, "mine").score or 0.0) > -np.inf


def test_what_does_not_fit_is_refused() -> None:
    wide = FactorGraph.of([9, 9, 9], [(0, 1, 2)], [np.zeros((9, 9, 9))])
    assert decode_factors(wide).status is Status.EXACT
    many = [(i, j) for i in range(40) for j in range(i)]
    complete = FactorGraph.of([2] * 40, many, list(np.zeros((len(many), 2, 2))))
    two, bare = [2, 2], FactorGraph.of([2, 2], [], [])
    of = FactorGraph.of
    for error, message, call, arguments in (
        (InputError, "factor 0 of 3 nodes allows 729 labe", decode_factors, [wide, "trw-s"]),
        (InputError, "tables of more than 33,554,432", decode_factors, [complete]),
        (ConfigError, "unknown decoder", decode_factors, [wide, "none"]),
        (InputError, "factor 0 is .0, 3., but there is no node 3", of, [two, [(0, 3)], [0.0]]),
        (InputError, "a node comes twice", of, [two, [(0, 0)], [np.zeros((2, 2))]]),
        (InputError, "got 1 scopes but 2 tables", of, [two, [(0,)], [np.zeros(2)] * 2]),
        (InputError, "table 0 must have shape", of, [two, [(0, 1)], [np.zeros((2, 3))]]),
        (InputError, "known gives node 1 the label 2, but it has 2", bare.with_known, [[-1, 2]]),
        (InputError, "gives node 1 a label that it does not have", bare.score, [[0, 2]]),
    ):
        refused(error, message, call, *arguments)


@pytest.mark.parametrize("method", ["max-product", "sum-product"])
def test_no_single_node_improves_what_is_not_proved(method: str) -> None:
    n_unproved = 0
    for seed in range(60):
        graph = random_factors(seed)
        if graph.order < 3 or all_labelings(graph)[1].max() == -np.inf:
            continue
        found = decode_factors(graph, method)
        assert found.score is not None
        n_unproved += found.status is not Status.EXACT
        for node, size in enumerate(graph.n_labels):
            for label in range(size):
                labels = found.labels.copy()
                labels[node] = label
                assert graph.score(labels) <= found.score + 1e-12
    assert n_unproved > 5
