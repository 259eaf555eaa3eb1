"""Planar driving graphs: a node at every crossing, and a least distance between nodes."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from pgm_places.topology.driving_graph import Roads

APART_M = 1.0
"""Nodes nearer to each other than this become one where its edges are as good."""

DETOUR = 1.1
"""No way over a node becomes longer than this times what it was."""

_MOST_PASSES = 10
_FEW_PAIRS = 100_000
_SAME = 1e-6
"""Cells within which a node lies on an edge."""


def crossings(
    at: NDArray[np.float64], edges: NDArray[np.int64], others: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Where edges (E, 2) between nodes at (N, 2) meet other edges (F, 2) without a common node.

    Two edges meet where both go through a point that is not an end of both; edges along a line
    meet at the ends of one that lie within the other.

    Returns
    -------
    pairs : (C, 2) int64
        Positions in ``edges`` and in ``others``.
    shares : (C,) float64
        Where, as shares of the way along the first of them.

    Examples
    --------
    >>> at = np.array([[0.0, 0.0], [4.0, 4.0], [0.0, 4.0], [4.0, 0.0], [2.0, 2.0]])
    >>> pairs, shares = crossings(at, np.array([[0, 1]]), np.array([[2, 3], [0, 2]]))
    >>> pairs.tolist(), shares.tolist()
    ([[0, 0]], [0.5])
    """
    pairs = _near_pairs(at, edges, others)
    first, second = edges[pairs[:, 0]], others[pairs[:, 1]]
    apart = (first[:, :, None] != second[:, None, :]).all(axis=(1, 2))
    pairs, first, second = pairs[apart], first[apart], second[apart]
    a, c = at[first[:, 0]], at[second[:, 0]]
    ab, cd = at[first[:, 1]] - a, at[second[:, 1]] - c
    cross = _cross(ab, cd)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = _cross(c - a, cd) / cross, _cross(c - a, ab) / cross
    slack = [_SAME / np.maximum(np.hypot(*part.T), _SAME) for part in (ab, cd)]
    meets = (along > -slack[0]) & (along < 1 + slack[0])
    meets &= (across > -slack[1]) & (across < 1 + slack[1]) & (np.abs(cross) > _SAME)
    return pairs[meets], along[meets].clip(0, 1)


def _near_pairs(
    at: NDArray[np.float64], edges: NDArray[np.int64], others: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(P, 2) positions of edges and of others that are near enough to meet."""
    if len(edges) * len(others) <= _FEW_PAIRS:
        return np.indices((len(edges), len(others))).reshape(2, -1).T
    from scipy.spatial import cKDTree

    middles = [at[part].mean(axis=1) for part in (edges, others)]
    reach = sum(
        np.hypot(*(at[part[:, 0]] - at[part[:, 1]]).T).max() / 2 for part in (edges, others)
    )
    trees = [cKDTree(middle) for middle in middles]
    found = trees[0].sparse_distance_matrix(trees[1], float(reach) + 1, output_type="ndarray")
    return np.stack([found["i"], found["j"]], axis=1)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def nodes_within(
    at: NDArray[np.float64], edges: NDArray[np.int64], nodes: NDArray[np.int64]
) -> list[tuple[int, int]]:
    """Edges (E, 2), by position, and the nodes that lie on them without being their ends."""
    found = []
    for position, (first, last) in enumerate(edges.tolist()):
        way = at[last] - at[first]
        length = float(np.hypot(*way))
        offset = at[nodes] - at[first]
        along = offset @ way / length
        beside = np.abs(way[0] * offset[:, 1] - way[1] * offset[:, 0]) / length
        on = (beside < _SAME) & (along > _SAME) & (along < length - _SAME)
        found += [(position, int(node)) for node in nodes[on] if node not in (first, last)]
    return found


def make_planar(roads: Roads) -> None:
    """Put a node wherever edges cross, and let nodes that are too near each other become one."""
    _split(roads)
    roads.merge(APART_M, partial(_stands_in, roads))


def _split(roads: Roads) -> None:
    """Divide edges at nodes that lie on them, and crossing edges at a new node."""
    for _ in range(_MOST_PASSES):
        edges = roads.joined()
        kept = np.array(sorted(roads.links), np.int64)
        stops: dict[int, set[int]] = {}
        for position, node in nodes_within(roads.at, edges, kept):
            stops.setdefault(position, set()).add(node)
        pairs, shares = crossings(roads.at, edges, edges)
        at = roads.at
        for (first, second), share in zip(pairs.tolist(), shares.tolist(), strict=True):
            if first > second:
                continue
            a, b = at[edges[first]]
            point = a + share * (b - a)
            ends = np.concatenate([edges[first], edges[second]])
            distances = np.hypot(*(at[ends] - point).T)
            nearest = int(distances.argmin())
            if distances[nearest] < _SAME:  # an end of one lies on the other
                continue
            node = roads.add((float(point[0]), float(point[1])))
            stops.setdefault(first, set()).add(node)
            stops.setdefault(second, set()).add(node)
        if not stops:
            return
        at = roads.at
        for position, nodes in stops.items():
            first, last = edges[position].tolist()
            roads.part(first, last)
            order = sorted(nodes, key=lambda node: float(np.hypot(*(at[node] - at[first]))))
            for one, other in zip([first, *order], [*order, last], strict=True):
                roads.join(one, other)


def _stands_in(roads: Roads, node: int, other: int) -> bool:
    """Whether another node can take a node's edges over without a crossing or a detour."""
    new = sorted(roads.links[node] - roads.links[other] - {other})
    pairs = np.array([[other, end] for end in new], np.int64).reshape(-1, 2)
    ends = roads.at[[*roads.links[node]]]
    return (
        _detour(ends, roads.at[node], roads.at[other]) <= DETOUR
        and bool(roads.are_good(pairs).all())
        and _stays_planar(roads, node, pairs)
    )


def _detour(ends: NDArray[np.float64], old: NDArray[np.float64], new: NDArray[np.float64]) -> float:
    """How many times longer ways between ends (n, 2) become that go through another point."""
    before, after = (np.hypot(*(ends - point).T) for point in (old, new))
    longer = (after[:, None] + after) / (before[:, None] + before)
    return float(longer[np.triu_indices(len(ends), 1)].max(initial=1.0))


def _stays_planar(roads: Roads, node: int, pairs: NDArray[np.int64]) -> bool:
    """Whether new edges cross none but those of a node that goes, and pass through no node."""
    edges = roads.joined()
    edges = edges[(edges != node).all(axis=1)]
    if len(crossings(roads.at, pairs, edges)[0]):
        return False
    kept = np.array(sorted(roads.links.keys() - {node}), np.int64)
    return not nodes_within(roads.at, pairs, kept)
