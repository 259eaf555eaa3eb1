"""Values of nodes and edges, from mappings by name and from sparse matrices."""

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places._checks import number_array
from pgm_places.errors import InputError
from pgm_places.graph._edges import require_sparse

__all__ = ["mapped_edges", "mapped_nodes", "matrix_edges"]


def matrix_edges(n_nodes: int, edges: NDArray[np.int32], matrix: Any) -> NDArray[np.float64]:
    """(E,) the stored entry of a matrix at each edge, the larger of two, 0 where there is none."""
    require_sparse(matrix)
    if matrix.shape != (n_nodes, n_nodes):
        raise InputError(f"matrix must have shape ({n_nodes}, {n_nodes}), got {matrix.shape}")
    entries = matrix.tocsr().tocoo()  # entries that come twice are added up
    row, column = entries.row.astype(np.int64), entries.col.astype(np.int64)
    wanted = edges[:, 0].astype(np.int64) * n_nodes + edges[:, 1]
    key = np.minimum(row, column) * n_nodes + np.maximum(row, column)
    at = np.minimum(np.searchsorted(wanted, key), max(len(wanted) - 1, 0))
    there = wanted[at] == key if len(wanted) else np.zeros(len(key), np.bool_)
    values = np.full(len(edges), -np.inf)
    np.maximum.at(values, at[there], number_array("matrix", entries.data)[there])
    met = np.zeros(len(edges), np.bool_)
    met[at[there]] = True
    return np.where(met, values, 0.0)


def mapped_edges(
    names: tuple[Hashable, ...] | range,
    edges: NDArray[np.int32],
    values: Mapping[tuple[Hashable, Hashable], Any],
    default: Any,
) -> NDArray[np.float64]:
    """(E,) the value of each edge by its two names in either order, the larger of two."""
    found = []
    for i, j in edges.tolist():
        pair = (names[i], names[j])
        both = [values[key] for key in (pair, pair[::-1]) if key in values]
        if not both and default is None:
            raise InputError(f"values has none for the edge {pair!r}; give a default")
        found.append(max(both) if both else default)
    return number_array("values", found)


def mapped_nodes(
    names: tuple[Hashable, ...] | range, values: Mapping[Hashable, Any], default: Any
) -> NDArray[Any]:
    """(N, ...) the value of each node by its name."""
    missing = [name for name in names if name not in values]
    if missing and default is None:
        raise InputError(
            f"values has none for {len(missing)} nodes, the first {missing[0]!r}; give a default"
        )
    return np.array([values.get(name, default) for name in names])
