"""Kernel of the search for a labelling that breaks no rule: propagate, decide, take back."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs
from pgm_places.solvers._pairwise_kernels import Terms, edge_score

__all__ = ["FOUND", "GIVEN_UP", "NONE_EXISTS", "SearchSpace", "find_allowed"]

FOUND, GIVEN_UP, NONE_EXISTS = 1, 0, -1

_ONE = np.uint32(1)


class SearchSpace(NamedTuple):
    """Working arrays; a labelling that was found is the one label that each node has left."""

    alive: NDArray[np.bool_]
    """(N, K) labels that are still possible."""
    n_alive: NDArray[np.int32]
    """(N,) how many each node has."""
    trail: NDArray[np.int64]
    """(N K,) node and label of each that was ruled out, in order."""
    decided: NDArray[np.int64]
    """(N, 3) node and label of each decision, and the length of the trail before it."""
    ring: NDArray[np.uint32]
    """(N,) nodes whose neighbours must be looked at."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    counts: NDArray[np.int64]
    """(3,) lengths of the trail and of the ring, and where the ring begins."""


@njit
def find_allowed(
    terms: Terms, arcs: Arcs, wanted: NDArray[np.int32], max_failures: int, space: SearchSpace
) -> int:
    """Search for a labelling without -inf, near ``wanted`` (N,); FOUND, GIVEN_UP or NONE_EXISTS.

    Nodes are decided in index order. After each decision the labels that no neighbour supports any
    more are ruled out (arc consistency), so that on a forest nothing is ever taken back.
    """
    alive, n_alive, trail, decided, _, waiting, counts = space
    n_nodes, n_labels = terms.unary.shape
    counts[:] = 0
    for i in range(n_nodes):
        n_alive[i] = 0
        waiting[i] = False
        for k in range(n_labels):
            alive[i, k] = terms.unary[i, k] > -np.inf
            n_alive[i] += alive[i, k]
    for i in range(n_nodes):
        _look_around(i, space)
    if not _propagate(terms, arcs, space):
        return NONE_EXISTS
    node = 0
    n_decided = 0
    n_failures = 0
    while True:
        while node < n_nodes and n_alive[node] == 1:
            node += 1
        if node == n_nodes:
            return FOUND
        label = wanted[node]
        if not alive[node, label]:
            label = _best_alive(node, terms, arcs, alive, n_alive)
        decided[n_decided, 0] = node
        decided[n_decided, 1] = label
        decided[n_decided, 2] = counts[0]
        n_decided += 1
        for k in range(n_labels):
            if k != label and alive[node, k]:
                _rule_out(node, k, space)
        _look_around(node, space)
        while not _propagate(terms, arcs, space):
            n_failures += 1
            if n_failures > max_failures:
                return GIVEN_UP
            if n_decided == 0:
                return NONE_EXISTS
            n_decided -= 1
            node = decided[n_decided, 0]
            while counts[0] > decided[n_decided, 2]:
                counts[0] -= 1
                i, k = divmod(trail[counts[0]], n_labels)
                alive[i, k] = True
                n_alive[i] += 1
            _rule_out(node, decided[n_decided, 1], space)
            _look_around(node, space)


@njit
def _rule_out(i: int | np.int64, k: int, space: SearchSpace) -> None:
    space.alive[i, k] = False
    space.n_alive[i] -= 1
    space.trail[space.counts[0]] = i * space.alive.shape[1] + k
    space.counts[0] += 1


@njit
def _look_around(i: int | np.int64, space: SearchSpace) -> None:
    """Have the neighbours of ``i`` looked at when labels are propagated next."""
    if not space.waiting[i]:
        space.waiting[i] = True
        last = space.counts[2] + space.counts[1]
        n_ring = space.ring.shape[0]
        space.ring[last if last < n_ring else last - n_ring] = i
        space.counts[1] += 1


@njit
def _propagate(terms: Terms, arcs: Arcs, space: SearchSpace) -> bool:
    """Rule out what no neighbour supports, until nothing changes; False if a node has none left."""
    alive, n_alive, _, _, ring, waiting, counts = space
    n_labels = alive.shape[1]
    possible = True
    while counts[1] > 0:
        j = ring[counts[2]]
        counts[2] = counts[2] + 1 if counts[2] + 1 < ring.shape[0] else 0
        counts[1] -= 1
        waiting[j] = False
        if not possible:
            continue  # only the ring is emptied
        for slot in range(arcs.start[j], arcs.start[j + _ONE]):
            i = np.int64(arcs.head[slot])
            changed = False
            for k in range(n_labels):
                if not alive[i, k]:
                    continue
                supported = False
                for other in range(n_labels):
                    if alive[j, other]:
                        pair = edge_score(terms.pairwise, arcs.arc[slot], other, k)
                        supported = supported or pair > -np.inf
                if not supported:
                    _rule_out(i, k, space)
                    changed = True
            possible = possible and n_alive[i] > 0
            if changed and possible:
                _look_around(i, space)
    return possible


@njit
def _best_alive(
    i: int,
    terms: Terms,
    arcs: Arcs,
    alive: NDArray[np.bool_],
    n_alive: NDArray[np.int32],
) -> int:
    """The label with the largest potential beside the neighbours that have one label left."""
    best = -1
    best_value = -np.inf
    for k in range(alive.shape[1]):
        if not alive[i, k]:
            continue
        value = terms.unary[i, k]
        for slot in range(arcs.start[i], arcs.start[i + 1]):
            j = arcs.head[slot]
            if n_alive[j] == 1:
                value += edge_score(terms.pairwise, arcs.arc[slot], k, alive[j].argmax())
        if best < 0 or value > best_value:
            best = k
            best_value = value
    return best
