"""The minimum cut between a source and a sink, on exact float64 capacities."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import finite_array, frozen_copy
from pgm_places._core import minimum_cut_kernel, parted_capacity
from pgm_places.errors import InputError
from pgm_places.solvers.adjacency import adjacency

SOURCE, SINK = 1, 2
"""Sides of a node; 0 is free."""


class CutSpace(NamedTuple):
    """Working arrays of one minimum cut, to be reused for the next; ``side`` is its result."""

    side: NDArray[np.int8]
    """(N,) tree of each node."""
    path: NDArray[np.uint32]
    """(N, 4) the path to the root: the arc that leads to the parent or a mark above all arcs, the
    parent, the time at which the path was last valid, its length."""
    active: NDArray[np.uint32]
    """(N,) ring of nodes that may grow."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    orphans: NDArray[np.uint32]
    """(N,) ring of nodes that lost their parent."""


@dataclass(frozen=True, eq=False)
class MinimumCut:
    """A minimum cut between source and sink."""

    value: float
    """The sum of the capacities that lead from the source's side to the sink's, which is also the
    largest flow."""
    source_side: NDArray[np.bool_]
    """(N,) nodes on the source's side: all nodes that the source reaches in the residual graph of a
    maximum flow. This is the minimum cut with the smallest source side."""


def minimum_cut(
    source_capacity: ArrayLike,
    sink_capacity: ArrayLike,
    edges: ArrayLike,
    forward: ArrayLike,
    backward: ArrayLike,
) -> MinimumCut:
    """The minimum cut between a source and a sink that are joined to N nodes.

    Capacities are float64 without scaling to integers: if they are multiples of one power of two
    and their sum is below 2**53 times this power (integers, for instance), every step is exact and
    so is the cut. Otherwise the flow's subtractions round, and the value is within
    ``1e-12`` of the largest flow, relative to the sum of all capacities.

    Parameters
    ----------
    source_capacity, sink_capacity : (N,) float
        Capacity from the source to each node, and from each node to the sink; at least 0.
    edges : (E, 2) int
        Pairs of nodes, in any order; parallel edges add up.
    forward, backward : (E,) float
        Capacity of each edge from its first node to its second, and back; at least 0.

    Raises
    ------
    InputError
        A shape does not fit, or a capacity is negative or not finite.

    Notes
    -----
    Boykov and Kolmogorov, PAMI 2004.

    Examples
    --------
    >>> cut = minimum_cut([3.0, 0.0], [0.0, 2.0], [(0, 1)], [1.0], [0.0])
    >>> cut.value, cut.source_side.tolist()
    (1.0, [True, False])
    """
    source = _capacities("source_capacity", source_capacity, "N")
    sink = _capacities("sink_capacity", sink_capacity, len(source))
    around = adjacency(len(source), edges)
    ahead = _capacities("forward", forward, around.n_edges)
    back = _capacities("backward", backward, around.n_edges)
    space = cut_space(len(source))
    minimum_cut_kernel(
        len(source), around.arcs, source - sink, np.stack([ahead, back], axis=1).ravel(), space
    )
    inside = space.side == SOURCE
    value = source[~inside].sum() + sink[inside].sum()
    value += parted_capacity(around.edges, inside, ahead, back)
    return MinimumCut(float(value), frozen_copy(inside))


def cut_space(n_nodes: int) -> CutSpace:
    """Working arrays for cuts of a graph of ``n_nodes`` nodes."""
    return CutSpace(
        side=np.empty(n_nodes, np.int8),
        path=np.empty((n_nodes, 4), np.uint32),
        active=np.empty(n_nodes, np.uint32),
        waiting=np.empty(n_nodes, np.bool_),
        orphans=np.empty(n_nodes, np.uint32),
    )


def _capacities(name: str, values: ArrayLike, size: int | str) -> NDArray[np.float64]:
    array = finite_array(name, values, (size,))
    low = np.flatnonzero(array < 0)
    if len(low):
        raise InputError(
            f"{name} must be at least 0, got {array[low[0]]} at index {low[0]}; a negative "
            "terminal capacity is a capacity to the other terminal"
        )
    return np.ascontiguousarray(array)
