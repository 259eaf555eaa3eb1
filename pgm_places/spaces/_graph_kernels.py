"""The position of a node in a graph: shortest paths through it, connectivity without it."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["add_paths", "largest_rests", "number_components"]


@njit
def add_paths(
    sources: NDArray[np.int64],
    component: NDArray[np.int32],
    most: int,
    start: NDArray[np.int32],
    neighbour: NDArray[np.int32],
    share: NDArray[np.float64],
) -> None:
    """Write the share of shortest paths that pass through each node, of those from some sources.

    These are the first ``most`` of the ``sources`` in every component. ``share`` (N,) is 0 on
    entry; the neighbours of node i are ``neighbour[start[i]:start[i + 1]]``.
    """
    n = len(share)
    order, distance = np.empty(n, np.int32), np.empty(n, np.int32)
    paths, passed = np.empty(n), np.empty(n)
    taken, reached = np.zeros(n, np.int64), np.ones(n, np.int64)  # by component
    is_source = np.zeros(n, np.int64)
    for i in range(n):
        distance[i] = -1
    for source in sources:
        home = component[source]
        if taken[home] < most:
            taken[home] += 1
            is_source[source] = 1
            reached[home] = _add_paths_from(
                source, start, neighbour, share, order, distance, paths, passed
            )
    for i in range(n):  # paths that start at the node itself do not lead through it
        home = component[i]
        pairs = (taken[home] - is_source[i]) * (reached[home] - 2)
        share[i] = share[i] / pairs if pairs > 0 else 0.0


@njit
def _add_paths_from(
    source: int,
    start: NDArray[np.int32],
    neighbour: NDArray[np.int32],
    share: NDArray[np.float64],
    order: NDArray[np.int32],
    distance: NDArray[np.int32],
    paths: NDArray[np.float64],
    passed: NDArray[np.float64],
) -> int:
    """Add to ``share`` (N,) the shares of shortest paths from ``source`` that pass through nodes.

    Brandes (2001). The neighbours of node i are ``neighbour[start[i]:start[i + 1]]``; ``distance``
    is -1 on entry and on return, the others are scratch (N,). Returns the number of nodes reached,
    including the source.
    """
    order[0] = source
    distance[source] = 0
    paths[source] = 1.0
    end, at = 1, 0
    while at < end:
        i = order[at]
        at += 1
        for e in range(start[i], start[i + 1]):
            j = neighbour[e]
            if distance[j] < 0:
                distance[j] = distance[i] + 1
                paths[j] = 0.0
                order[end] = j
                end += 1
            if distance[j] == distance[i] + 1:
                paths[j] += paths[i]
    for q in range(end):
        passed[order[q]] = 0.0
    for q in range(end - 1, 0, -1):
        j = order[q]
        for e in range(start[j], start[j + 1]):
            i = neighbour[e]
            if distance[i] == distance[j] - 1:
                passed[i] += paths[i] / paths[j] * (1.0 + passed[j])
        share[j] += passed[j]
    for q in range(end):
        distance[order[q]] = -1
    return end


@njit
def largest_rests(
    start: NDArray[np.int32],
    neighbour: NDArray[np.int32],
    weight: NDArray[np.float64],
    rest: NDArray[np.float64],
    whole: NDArray[np.float64],
) -> None:
    """Write the weight of each node's component, and of its largest part without the node.

    Depth-first search (Hopcroft and Tarjan, 1973): a child's subtree is cut off if no edge leads
    from it to an ancestor of the node.
    """
    n = len(weight)
    seen = np.empty(n, np.int64)  # the order of discovery
    lowest, parent, edge = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    stack, found = np.empty(n, np.int64), np.empty(n, np.int64)
    below, largest = np.empty(n), np.empty(n)  # of the subtree; of the subtrees cut off
    cut = np.empty(n)  # total of the latter
    for i in range(n):
        seen[i] = parent[i] = -1
        edge[i] = start[i]
        below[i] = weight[i]
        cut[i] = largest[i] = 0.0
    time = 0
    for root in range(n):
        if seen[root] >= 0:
            continue
        first, top = time, 1
        stack[0] = root
        while top > 0:
            i = stack[top - 1]
            if seen[i] < 0:
                seen[i] = lowest[i] = time
                found[time] = i
                time += 1
            if edge[i] < start[i + 1]:
                j = neighbour[edge[i]]
                edge[i] += 1
                if seen[j] < 0:
                    parent[j] = i
                    stack[top] = j
                    top += 1
                elif j != parent[i]:
                    lowest[i] = min(lowest[i], seen[j])
                continue
            top -= 1
            p = parent[i]
            if p >= 0:
                lowest[p] = min(lowest[p], lowest[i])
                below[p] += below[i]
                if lowest[i] >= seen[p]:
                    cut[p] += below[i]
                    largest[p] = max(largest[p], below[i])
        for t in range(first, time):
            i = found[t]
            whole[i] = below[root]
            rest[i] = max(largest[i], below[root] - weight[i] - cut[i])


@njit
def number_components(
    start: NDArray[np.int32], neighbour: NDArray[np.int32], component: NDArray[np.int32]
) -> None:
    """Write the number of each node's component (N,), in the order of their first nodes."""
    n = len(component)
    waiting = np.empty(n, np.int32)
    for i in range(n):
        component[i] = -1
    count = 0
    for first in range(n):
        if component[first] >= 0:
            continue
        component[first] = count
        waiting[0] = first
        end = 1
        while end > 0:
            end -= 1
            i = waiting[end]
            for e in range(start[i], start[i + 1]):
                j = neighbour[e]
                if component[j] < 0:
                    component[j] = count
                    waiting[end] = j
                    end += 1
        count += 1
