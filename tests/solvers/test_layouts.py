"""Solvers take arrays of any layout in memory."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pgm_places.solvers.belief_propagation import belief_propagation
from pgm_places.solvers.forest import forest_marginals, forest_maximum
from pgm_places.solvers.forward import filtered_beliefs, markov_chain, smoothed_beliefs, viterbi
from pgm_places.solvers.graph_cut import alpha_expansion, minimum_cut
from pgm_places.solvers.grid_relaxation import relax_grid
from pgm_places.solvers.local_search import iterated_conditional_modes
from pgm_places.solvers.mean_field import grid_mean_field, mean_field
from pgm_places.solvers.pairwise import pairwise_model
from pgm_places.solvers.relaxation import relax_graph, starting_beliefs
from pgm_places.solvers.semi_markov import SemiMarkovChain
from pgm_places.solvers.trws import trws
from tests.layouts import CHANGES, Array, check_any_layout

N, K = 6, 3
RNG = np.random.default_rng(0)
UNARY = RNG.normal(size=(N, K))
EDGES = np.array([[0, 1], [1, 2], [3, 2], [4, 3], [4, 5]])
AGREEMENT = RNG.uniform(size=(len(EDGES), K))
TABLES = -np.abs(RNG.normal(size=(len(EDGES), K, K)))
CELLS = np.argwhere(np.ones((2, 3), bool))
CHAIN = (np.full(K, 1 / K), np.eye(K) * 0.7 + 0.1, UNARY)
CAPACITIES = tuple(RNG.uniform(size=n) for n in (N, N, len(EDGES), len(EDGES)))
STRETCHES = (
    CHAIN[0],
    (1 - np.eye(K)) / (K - 1),
    np.array([0.0, 1.0]),
    RNG.uniform(0.5, 2.0, (K, 2)),
    np.full(N - 1, 0.5),
    UNARY,
)


def on_model(solve: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arrays: solve(pairwise_model(*arrays))


FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Array, ...]]] = {
    "cut": (
        lambda source, sink, ahead, back, edges: minimum_cut(source, sink, edges, ahead, back),
        (*CAPACITIES, EDGES),
    ),
    "expansion": (on_model(alpha_expansion), (UNARY, EDGES, AGREEMENT)),
    "modes": (on_model(iterated_conditional_modes), (UNARY, EDGES, AGREEMENT)),
    "modes by tables": (
        lambda u, e, t: iterated_conditional_modes(pairwise_model(u, e, pairwise=t)),
        (UNARY, EDGES, TABLES),
    ),
    "mean field": (on_model(mean_field), (UNARY, EDGES, AGREEMENT)),
    "messages": (on_model(belief_propagation), (UNARY, EDGES, AGREEMENT)),
    "messages by tables": (
        lambda u, e, t: belief_propagation(pairwise_model(u, e, pairwise=t)),
        (UNARY, EDGES, TABLES),
    ),
    "trws": (on_model(trws), (UNARY, EDGES, AGREEMENT)),
    "forest": (on_model(forest_maximum), (UNARY, EDGES, AGREEMENT)),
    "marginals": (
        lambda u, e, t: forest_marginals(pairwise_model(u, e, pairwise=t)),
        (UNARY, EDGES, TABLES),
    ),
    "grid mean field": (grid_mean_field, (UNARY, CELLS, np.eye(K))),
    "grid relaxation": (
        lambda u, c, r: relax_grid(u, c, (2, 3), r, max_iterations=3),
        (UNARY, CELLS, RNG.uniform(-1, 1, (1, K + 1, K + 1))),
    ),
    "relaxation": (
        lambda u, start, node, r: relax_graph(u, start, node, r, max_iterations=3),
        (UNARY, np.array([0, 1, 2, 3, 4, 5, 6]), np.array([1, 2, 3, 4, 5, 0]), np.eye(K)[None]),
    ),
    "start": (starting_beliefs, (UNARY,)),
    "filter": (lambda *chain: filtered_beliefs(markov_chain(*chain)), CHAIN),
    "smoother": (lambda *chain: smoothed_beliefs(markov_chain(*chain)), CHAIN),
    "viterbi": (lambda *chain: viterbi(markov_chain(*chain)), CHAIN),
    "stretches": (lambda *a: SemiMarkovChain(*a[:4]).smoothed(*a[4:]), STRETCHES),
    "best stretches": (lambda *a: SemiMarkovChain(*a[:4]).viterbi(*a[4:]), STRETCHES),
    "a stretch": (lambda *a: SemiMarkovChain(*a[:4]).step(a[5][0])[0], STRETCHES),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_gives_the_same(name: str, change: Callable[[Array], Array]) -> None:
    check_any_layout(*FUNCTIONS[name], change)
