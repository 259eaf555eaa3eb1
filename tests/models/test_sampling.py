"""Samples against the probabilities that enumeration gives."""

import networkx as nx
import numpy as np
import pytest

from pgm_places import LabelGraph, Potentials
from pgm_places.errors import InputError
from pgm_places.models.sampling import sample
from tests.reference.energy import Model, distribution, pair_marginals

N_SAMPLES = 20_000
FIVE_SIGMA = 5 * 0.5 / np.sqrt(N_SAMPLES)
"""A frequency strays further from its probability once in a million times; seeds are fixed."""


@pytest.mark.parametrize("seed", range(4))
def test_samples_on_trees_have_the_marginals_of_nodes_and_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edges = np.array([sorted(edge) for edge in nx.random_labeled_tree(6, seed=seed).edges])
    graph = LabelGraph.from_edges(6, edges)
    potentials = Potentials(rng.normal(size=(6, 3)), rng.normal(size=(5, 3, 3)))
    drawn = sample(graph, potentials, N_SAMPLES, seed=seed)
    model = Model(potentials.unary, graph.edges.astype(np.int64), pairwise=potentials.pairwise)
    assert drawn.exact
    assert np.abs(drawn.frequencies(3) - distribution(model)[0]).max() < FIVE_SIGMA
    first, second = drawn.labels[:, graph.edges].transpose(2, 0, 1)
    for pair in range(9):
        shares = ((first == pair // 3) & (second == pair % 3)).mean(axis=0)
        expected = pair_marginals(model)[:, pair // 3, pair % 3]
        assert np.abs(shares - expected).max() < FIVE_SIGMA


def test_what_is_known_or_forbidden_is_never_drawn_otherwise() -> None:
    graph = LabelGraph.from_lattice((5,))
    table = np.where(np.tri(3, k=-1, dtype=bool), -np.inf, 0.0)  # labels never fall
    drawn = sample(graph, Potentials(np.zeros((5, 3)), table), 500, known=[-1, 1, -1, -1, -1])
    assert (drawn.labels[:, 1] == 1).all()
    assert (np.diff(drawn.labels, axis=1) >= 0).all()
    assert len(np.unique(drawn.labels[:, 4])) == 2


@pytest.mark.parametrize("seed", range(2))
def test_samples_on_cycles_that_few_nodes_separate_are_exact_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph = LabelGraph.from_lattice((2, 3))
    potentials = Potentials(rng.normal(size=(6, 3)), rng.normal(size=(graph.n_edges, 3, 3)))
    drawn = sample(graph, potentials, N_SAMPLES, seed=seed)
    model = Model(potentials.unary, graph.edges.astype(np.int64), pairwise=potentials.pairwise)
    assert drawn.exact
    assert np.abs(drawn.frequencies(3) - distribution(model)[0]).max() < FIVE_SIGMA


def test_perturbed_decoding_is_exact_where_nodes_do_not_touch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A ring of three whose edges say nothing, as if it were too wide for exact samples."""
    monkeypatch.setattr("pgm_places.models.sampling.BucketTree.of", lambda model: None)
    graph = LabelGraph.from_edges(4, [(0, 1), (1, 2), (0, 2)])
    p = np.random.default_rng(0).dirichlet(np.ones(3), 4)
    n = 1500
    drawn = sample(graph, Potentials(np.log(p), agreement=np.zeros((3, 3))), n)
    assert not drawn.exact
    assert np.abs(drawn.frequencies(3) - p).max() < 5 * 0.5 / np.sqrt(n)


def test_the_same_seed_draws_the_same() -> None:
    graph = LabelGraph.from_lattice((3, 3))
    potentials = Potentials.potts(np.random.default_rng(0).normal(size=(9, 3)), 0.5)
    first, again = (sample(graph, potentials, 5, seed=3).labels for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert (first != sample(graph, potentials, 5, seed=4).labels).any()


def test_wrong_input_is_refused() -> None:
    graph = LabelGraph.from_lattice((3,))
    with pytest.raises(InputError, match="n_samples must be at least 1, got 0"):
        sample(graph, Potentials(np.zeros((3, 2))), 0)
    with pytest.raises(InputError, match="unary has 2 rows but the graph has 3 nodes"):
        sample(graph, Potentials(np.zeros((2, 2))), 1)
