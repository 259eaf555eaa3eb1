"""Sets of nodes as further nodes: energies and cuts against all labellings."""

import itertools

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.graph.cliques import Cliques
from pgm_places.solvers.set_terms import SetNodes
from tests.reference.cliques import set_score

GRAPHS = [graph for graph in nx.graph_atlas_g() if 2 <= len(graph) <= 6]


def random_sets(rng: np.random.Generator, n: int) -> list[list[int]]:
    sizes = rng.integers(1, n + 1, size=rng.integers(1, 4))
    return [sorted(rng.choice(n, size, replace=False).tolist()) for size in sizes]


def best_of_set_nodes(
    sets: SetNodes, rewards: NDArray[np.float64], labels: tuple[int, ...]
) -> float:
    """What the nodes of sets and their links add at best, each such node by itself."""
    unary = sets.unary(np.zeros((sets.n_nodes, sets.n_labels)), rewards)
    gains = unary[sets.n_nodes :].copy()
    for (node, at), reward in zip(sets.links, sets.link_rewards(rewards), strict=True):
        gains[at - sets.n_nodes, labels[node]] += reward[labels[node]]
    return float(gains.max(axis=1).sum())


@pytest.mark.parametrize("n_labels", [1, 2, 3])
@pytest.mark.parametrize("dissent", [0.1, 0.4, 0.5, 0.7, 1.0])
def test_set_nodes_add_what_the_definition_says(n_labels: int, dissent: float) -> None:
    for n in range(2, 7):
        rng = np.random.default_rng(n)
        members = random_sets(rng, n)
        sets = SetNodes(Cliques.of(members, n), n, n_labels, dissent)
        rewards = rng.random((len(members), n_labels))
        for labels in itertools.product(range(n_labels), repeat=n):
            wanted = sum(
                set_score(s, labels, r, dissent)
                for s, r in zip(members, rewards.tolist(), strict=True)
            )
            assert sets.score(rewards, np.array(labels)) == pytest.approx(wanted, abs=1e-12)
            assert best_of_set_nodes(sets, rewards, labels) == pytest.approx(wanted, abs=1e-12)


def total_score(
    unary: NDArray[np.float64],
    edges: NDArray[np.int64],
    agreement: NDArray[np.float64],
    members: list[list[int]],
    rewards: list[list[float]],
    dissent: float,
    labels: tuple[int, ...],
) -> float:
    """The definition, node by node, edge by edge, set by set."""
    found = sum(float(unary[i, k]) for i, k in enumerate(labels))
    for e, (i, j) in enumerate(edges):
        found += float(agreement[e, labels[i]]) if labels[i] == labels[j] else 0.0
    return found + sum(
        set_score(s, labels, r, dissent) for s, r in zip(members, rewards, strict=True)
    )


@pytest.mark.parametrize("dissent", [0.0, 1.5, float("nan")])
def test_a_dissent_that_is_no_share_is_refused(dissent: float) -> None:
    with pytest.raises(InputError, match=r"a set's dissent must be in \(0, 1\], got"):
        SetNodes(Cliques.of([[0]], 1), 1, 2, dissent)
