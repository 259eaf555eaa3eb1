"""The nodes of a forest in order: each after its parent, and how it is joined to it."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._core import forest_order
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import Adjacency


def is_forest(around: Adjacency) -> bool:
    """Whether a graph has no cycle."""
    return _closing_edge(around)[0] < 0


def rooted_forest(around: Adjacency) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Every node after its parent, and the arc to that parent.

    Raises
    ------
    InputError
        The graph has a cycle.
    """
    edge, order, parent = _closing_edge(around)
    if edge >= 0:
        i, j = around.edges[edge]
        raise InputError(
            f"exact inference needs a graph without cycles, but edge {edge} ({i}, {j}) closes one; "
            "use another decoder"
        )
    return order, parent


def _closing_edge(around: Adjacency) -> tuple[int, NDArray[np.uint32], NDArray[np.uint32]]:
    """The first edge that closes a cycle, -1 for none; the order and parents, whole without one."""
    order = np.empty(around.n_nodes, np.uint32)
    parent = np.empty(around.n_nodes, np.uint32)
    edge = forest_order(around.arcs, order, parent, np.zeros(around.n_nodes, np.bool_))
    return int(edge), order, parent
