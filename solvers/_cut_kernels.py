"""Kernels of the minimum cut: two search trees that grow, meet, push flow and mend themselves.

Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for energy
minimization in vision" (PAMI 2004), with their time stamps and distances, on float64 capacities.
An augmentation empties its narrowest arc to exactly 0.0, so the trees never hang on rounding.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places._jit import njit
from pgm_places.solvers._adjacency_kernels import Arcs

__all__ = ["FREE", "OUTSIDE", "SINK", "SOURCE", "CutSpace", "minimum_cut_kernel"]

FREE = 0
SOURCE = 1
SINK = 2
OUTSIDE = 3

_NONE = -1
_ROOT = -2
_ORPHAN = -3


class CutSpace(NamedTuple):
    """Working arrays of one minimum cut, to be reused for the next; ``side`` is its result."""

    side: NDArray[np.int8]
    """(N,) tree of each node; OUTSIDE takes a node out of the graph."""
    parent: NDArray[np.int32]
    """(N,) arc that leads to the parent, or one of the negative marks."""
    stamp: NDArray[np.int32]
    """(N,) when the way to the root was last known to be sound."""
    depth: NDArray[np.int32]
    """(N,) length of that way."""
    active: NDArray[np.int32]
    """(N,) ring of nodes that may grow."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    orphans: NDArray[np.int32]
    """(N,) ring of nodes that lost their parent."""


@njit
def minimum_cut_kernel(
    members: NDArray[np.int32],
    arcs: Arcs,
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    space: CutSpace,
) -> None:
    """Leave in ``space.side`` who can be reached from the source, who reaches the sink, and FREE.

    ``members`` are the nodes that take part; all others must be OUTSIDE. ``excess`` is the
    capacity from the source less that to the sink, ``capacity`` is per arc; both end as residuals.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, parent, stamp, depth = space.side, space.parent, space.stamp, space.depth
    active, waiting = space.active, space.waiting
    n_ring = active.shape[0]
    _plant(members, excess, space)
    first = 0
    n_active = 0
    for m in range(members.shape[0]):
        i = members[m]
        if side[i] != FREE:
            for slot in range(start[i], start[i + 1]):
                other = side[head[slot]]
                if other != side[i] and other != OUTSIDE:
                    active[n_active] = i
                    n_active += 1
                    waiting[i] = True
                    break
    clock = 0
    i = -1
    while True:
        if i < 0 or side[i] == FREE:
            i = -1
            while i < 0:
                if n_active == 0:
                    return
                i = active[first]
                first = first + 1 if first + 1 < n_ring else 0
                n_active -= 1
                waiting[i] = False
                if side[i] == FREE:
                    i = -1
        grown = side[i]
        back = grown - SOURCE  # the sink's tree grows against the arcs
        bridge = -1
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            tree = side[j]
            if tree == OUTSIDE or capacity[arc[slot] ^ back] <= 0.0:
                continue
            if tree == FREE:
                side[j] = grown
                parent[j] = arc[slot] ^ 1
                stamp[j] = stamp[i]
                depth[j] = depth[i] + 1
                if not waiting[j]:
                    n_active = _wake(j, first, n_active, active, waiting)
            elif tree != grown:
                bridge = arc[slot] ^ back
                break
            elif stamp[j] <= stamp[i] and depth[j] > depth[i] + 1:
                parent[j] = arc[slot] ^ 1
                stamp[j] = stamp[i]
                depth[j] = depth[i] + 1
        if bridge < 0:
            i = -1
            continue
        clock += 1
        n_orphans = _augment(bridge, arcs.ends, excess, capacity, parent, space.orphans)
        n_active = _adopt(n_orphans, clock, first, n_active, arcs, capacity, space)


@njit
def _plant(members: NDArray[np.int32], excess: NDArray[np.float64], space: CutSpace) -> None:
    for m in range(members.shape[0]):
        i = members[m]
        space.stamp[i] = 0
        space.depth[i] = 1
        space.waiting[i] = False
        space.parent[i] = _ROOT
        if excess[i] > 0.0:
            space.side[i] = SOURCE
        elif excess[i] < 0.0:
            space.side[i] = SINK
        else:
            space.side[i] = FREE
            space.parent[i] = _NONE


@njit
def _wake(
    i: int, first: int, n_active: int, active: NDArray[np.int32], waiting: NDArray[np.bool_]
) -> int:
    waiting[i] = True
    last = first + n_active
    active[last if last < active.shape[0] else last - active.shape[0]] = i
    return n_active + 1


@njit
def _augment(
    bridge: int,
    ends: NDArray[np.int32],
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    parent: NDArray[np.int32],
    orphans: NDArray[np.int32],
) -> int:
    """Push what fits through the arc ``bridge`` from the source's tree to the sink's."""
    push = capacity[bridge]
    i = ends[bridge]
    while parent[i] != _ROOT:
        push = min(push, capacity[parent[i] ^ 1])
        i = ends[parent[i] ^ 1]
    push = min(push, excess[i])
    i = ends[bridge ^ 1]
    while parent[i] != _ROOT:
        push = min(push, capacity[parent[i]])
        i = ends[parent[i] ^ 1]
    push = min(push, -excess[i])

    capacity[bridge] -= push
    capacity[bridge ^ 1] += push
    n_orphans = 0
    i = ends[bridge]
    while parent[i] != _ROOT:
        up = parent[i]
        capacity[up] += push
        capacity[up ^ 1] -= push
        if capacity[up ^ 1] <= 0.0:
            parent[i] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = ends[up ^ 1]
    excess[i] -= push
    if excess[i] <= 0.0:
        parent[i] = _ORPHAN
        orphans[n_orphans] = i
        n_orphans += 1
    i = ends[bridge ^ 1]
    while parent[i] != _ROOT:
        up = parent[i]
        capacity[up] -= push
        capacity[up ^ 1] += push
        if capacity[up] <= 0.0:
            parent[i] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = ends[up ^ 1]
    excess[i] += push
    if excess[i] >= 0.0:
        parent[i] = _ORPHAN
        orphans[n_orphans] = i
        n_orphans += 1
    return n_orphans


@njit
def _adopt(
    n_orphans: int,
    clock: int,
    first: int,
    n_active: int,
    arcs: Arcs,
    capacity: NDArray[np.float64],
    space: CutSpace,
) -> int:
    """Find every orphan a new parent in its tree or set it free; the new number of active."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, parent, stamp, depth = space.side, space.parent, space.stamp, space.depth
    orphans = space.orphans
    n_ring = orphans.shape[0]
    for k in range(n_orphans // 2):  # nearest to the roots first
        orphans[k], orphans[n_orphans - 1 - k] = orphans[n_orphans - 1 - k], orphans[k]
    done = 0
    while n_orphans > 0:
        i = orphans[done]
        done = done + 1 if done + 1 < n_ring else 0
        n_orphans -= 1
        tree = side[i]
        back = (
            SINK - tree
        )  # capacity from the neighbour for the source's tree, to it for the sink's
        best = _NONE
        best_depth = 2**31 - 1
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if side[j] == tree and capacity[arc[slot] ^ back] > 0.0 and parent[j] != _NONE:
                way = _depth_if_rooted(j, clock, arcs.ends, parent, stamp, depth)
                if 0 < way < best_depth:
                    best_depth = way
                    best = arc[slot]
        if best != _NONE:
            parent[i] = best
            stamp[i] = clock
            depth[i] = best_depth + 1
            continue
        parent[i] = _NONE
        side[i] = FREE
        for slot in range(start[i], start[i + 1]):
            j = head[slot]
            if side[j] != tree:
                continue
            if capacity[arc[slot] ^ back] > 0.0 and not space.waiting[j]:
                n_active = _wake(j, first, n_active, space.active, space.waiting)
            if parent[j] == arc[slot] ^ 1:
                parent[j] = _ORPHAN
                last = done + n_orphans
                orphans[last if last < n_ring else last - n_ring] = j
                n_orphans += 1
    return n_active


@njit
def _depth_if_rooted(
    i: int,
    clock: int,
    ends: NDArray[np.int32],
    parent: NDArray[np.int32],
    stamp: NDArray[np.int32],
    depth: NDArray[np.int32],
) -> int:
    """How far ``i`` is from its root, 0 if its way ends at an orphan; marks the way when sound."""
    way = 0
    j = i
    while stamp[j] != clock:
        up = parent[j]
        way += 1
        if up == _ROOT:
            stamp[j] = clock
            depth[j] = 1
            break
        if up < 0:
            return 0
        j = ends[up ^ 1]
    else:
        way += depth[j]
    found = way
    j = i
    while stamp[j] != clock:
        stamp[j] = clock
        depth[j] = way
        way -= 1
        j = ends[parent[j] ^ 1]
    return found
