"""Edges as node pairs: what is canonical, and those of lattices, of points and of matrices."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import number_array
from pgm_places.errors import InputError

__all__ = [
    "empty_pairs",
    "lattice_edges",
    "nearest_pairs",
    "require_canonical",
    "require_same",
    "require_sparse",
    "sparse_pairs",
]


def empty_pairs(edges: ArrayLike, name: str = "edges") -> NDArray[Any]:
    """``edges`` as an array, of shape (0, 2) where there are none; (2, E) is refused by name."""
    pairs = number_array(name, edges, None)
    if pairs.ndim == 2 and pairs.shape[0] == 2 and pairs.shape[1] > 2:
        raise InputError(
            f"{name} must have shape (E, 2), got {pairs.shape}; transpose them: {name}.T"
        )
    return np.zeros((0, 2), np.int32) if pairs.size == 0 else pairs


def require_canonical(edges: NDArray[np.int64]) -> None:
    """Raise InputError unless (E, 2) pairs are ``i < j``, sorted, and each comes once."""
    if not len(edges):
        return
    loops = np.flatnonzero(edges[:, 0] == edges[:, 1])
    if len(loops):
        raise InputError(
            f"edge {int(loops[0])} joins node {edges[loops[0], 0]} to itself; leave such edges out"
        )
    turned = np.flatnonzero(edges[:, 0] > edges[:, 1])
    if len(turned):
        i, j = edges[turned[0]]
        raise InputError(
            f"edge {int(turned[0])} is ({i}, {j}) but i < j is required; use from_edges"
        )
    key = edges[:, 0] * (edges.max() + 1) + edges[:, 1]
    step = np.diff(key)
    if (step == 0).any():
        i, j = edges[int(np.flatnonzero(step == 0)[0])]
        raise InputError(f"edge ({i}, {j}) appears twice; each pair of nodes may be joined once")
    if (step < 0).any():
        raise InputError("edges must be sorted by (i, j); use LabelGraph.from_edges")


def require_same(pairs: NDArray[np.integer[Any]], edges: NDArray[np.int32]) -> None:
    """Raise InputError unless sorted pairs (E, 2) are the edges of a graph."""
    if pairs.shape == edges.shape and (pairs == edges).all():
        return
    given, there = set(map(tuple, pairs.tolist())), set(map(tuple, edges.tolist()))
    odd, missing = sorted(given - there), sorted(there - given)
    told = f"the pair {odd[0]} is no edge of it" if odd else f"its edge {missing[0]} is missing"
    raise InputError(
        f"pairs must be the {len(edges)} edges of the graph, each once, got {len(pairs)}; {told}"
    )


def lattice_edges(
    mask: NDArray[np.bool_], *, diagonals: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(E, 2) pairs of cells of a mask that differ by one step, and (E,) along how many axes."""
    number = np.full(tuple(size + 2 for size in mask.shape), -1, np.int64)
    inner = (slice(1, -1),) * mask.ndim
    number[inner][mask] = np.arange(int(mask.sum()))
    pairs, n_axes = [np.zeros((0, 2), np.int64)], [np.zeros(0, np.int64)]
    for step in product((-1, 0, 1), repeat=mask.ndim):
        moved = sum(map(abs, step))
        if step <= (0,) * mask.ndim or (moved > 1 and not diagonals):
            continue  # the other half of the steps are these, seen from the other end
        shifted = tuple(
            slice(1 + by, 1 + by + size) for by, size in zip(step, mask.shape, strict=True)
        )
        first, second = number[inner], number[shifted]
        both = (first >= 0) & (second >= 0)
        pairs.append(np.stack([first[both], second[both]], axis=1))
        n_axes.append(np.full(int(both.sum()), moved))
    return np.concatenate(pairs), np.concatenate(n_axes)


def nearest_pairs(points: NDArray[np.float64], n_neighbours: int) -> NDArray[np.int64]:
    """(E, 2) pairs, each once, of points of which one is among the other's nearest."""
    from scipy.spatial import cKDTree

    n = len(points)
    wanted = min(n_neighbours, n - 1)
    if wanted < 1:
        return np.zeros((0, 2), np.int64)
    near = np.asarray(cKDTree(points).query(points, k=wanted + 1)[1])
    own = np.arange(n)[:, None]
    # Among coincident points a point need not find itself first, or at all.
    others = near != own
    others[others.all(axis=1), -1] = False
    pairs = np.stack([np.repeat(own[:, 0], wanted), near[others]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def require_sparse(matrix: Any) -> None:
    """Raise InputError unless it is a sparse matrix or array of SciPy."""
    if not hasattr(matrix, "tocoo"):
        raise InputError(
            "matrix must be a sparse matrix or array of SciPy, got a "
            f"{type(matrix).__name__}; write scipy.sparse.csr_array(matrix)"
        )


def sparse_pairs(matrix: Any) -> tuple[int, NDArray[np.int64]]:
    """N and the (E, 2) pairs, each once, at which a square matrix is not 0 in either direction."""
    require_sparse(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise InputError(f"matrix must have shape (N, N), got {matrix.shape}")
    found = matrix.tocoo()
    row, column = found.row[found.data != 0], found.col[found.data != 0]
    loops = row[row == column]
    if len(loops):
        raise InputError(
            f"matrix must be 0 on its diagonal, got {len(loops)} other values, the first in row "
            f"{int(loops[0])}; clear it with matrix.setdiag(0)"
        )
    pairs = np.stack([np.minimum(row, column), np.maximum(row, column)], axis=1)
    return int(matrix.shape[0]), np.unique(pairs.astype(np.int64), axis=0)
