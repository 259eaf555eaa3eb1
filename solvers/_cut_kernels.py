"""Kernels of the minimum cut: two search trees that grow, meet, push flow and adopt orphans.

Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for energy
minimization in vision" (PAMI 2004), with their time stamps and distances, on float64 capacities.
An augmentation empties its narrowest arc to exactly 0.0, so the trees never hang on rounding.

Nodes and arcs are unsigned throughout: an index that may be negative costs the compiled code a
test at every access, a quarter of the time here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.solvers._adjacency_kernels import FORTH, REVERSE, Arcs

__all__ = ["FREE", "SINK", "SOURCE", "CutSpace", "minimum_cut_kernel"]

FREE = 0
SOURCE = 1
SINK = 2

_NONE = np.uint32(2**32 - 1)
_ROOT = np.uint32(2**32 - 2)
_ORPHAN = np.uint32(2**32 - 3)
_ONE = np.uint32(1)


class CutSpace(NamedTuple):
    """Working arrays of one minimum cut, to be reused for the next; ``side`` is its result."""

    side: NDArray[np.int8]
    """(N,) tree of each node."""
    parent: NDArray[np.uint32]
    """(N,) arc that leads to the parent, or one of the marks above all arcs."""
    stamp: NDArray[np.int32]
    """(N,) when the path to the root was last known to be sound."""
    depth: NDArray[np.int32]
    """(N,) length of that path."""
    active: NDArray[np.uint32]
    """(N,) ring of nodes that may grow."""
    waiting: NDArray[np.bool_]
    """(N,) whether a node is in that ring."""
    orphans: NDArray[np.uint32]
    """(N,) ring of nodes that lost their parent."""


@njit
def minimum_cut_kernel(
    n_nodes: int,
    arcs: Arcs,
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    space: CutSpace,
) -> None:
    """Leave in ``space.side`` who can be reached from the source, who reaches the sink, and FREE.

    The first ``n_nodes`` nodes take part. ``excess`` is the capacity from the source less that to
    the sink, ``capacity`` is per arc; both end as residuals. Arrays may be longer than needed.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, parent, stamp, depth = space.side, space.parent, space.stamp, space.depth
    active, waiting = space.active, space.waiting
    n_ring = active.shape[0]
    n_active = _plant(n_nodes, excess, space)
    first = 0
    clock = 0
    going_on = False
    i = np.uint32(0)
    while True:
        if not going_on or side[i] == FREE:
            if n_active == 0:
                return
            i = active[first]
            first = first + 1 if first + 1 < n_ring else 0
            n_active -= 1
            waiting[i] = False
            going_on = False
            if side[i] == FREE:
                continue
        grown = side[i]
        against = REVERSE if grown == SINK else FORTH
        bridge = _NONE
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if side[j] != grown and capacity[arc[slot] ^ against] > 0.0:
                if side[j] != FREE:
                    bridge = np.uint32(arc[slot] ^ against)
                    break
                side[j] = grown
                parent[j] = arc[slot] ^ REVERSE
                stamp[j] = stamp[i]
                depth[j] = depth[i] + 1
                if not waiting[j]:
                    n_active = _wake(j, first, n_active, active, waiting)
        going_on = bridge != _NONE
        if going_on:
            clock += 1
            n_orphans = _augment(bridge, arcs.ends, excess, capacity, parent, space.orphans)
            n_active = _adopt(n_orphans, clock, first, n_active, arcs, capacity, space)


@njit
def _plant(n_nodes: int, excess: NDArray[np.float64], space: CutSpace) -> int:
    """Make a root of every node that is joined to a terminal; how many there are."""
    side, parent, stamp, depth = space.side, space.parent, space.stamp, space.depth
    n_active = 0
    for i in range(n_nodes):
        stamp[i] = 0
        depth[i] = 1
        parent[i] = _ROOT
        if excess[i] > 0.0:
            side[i] = SOURCE
        elif excess[i] < 0.0:
            side[i] = SINK
        else:
            side[i] = FREE
            parent[i] = _NONE
            space.waiting[i] = False
            continue
        space.waiting[i] = True
        space.active[n_active] = i
        n_active += 1
    return n_active


@njit
def _wake(
    i: int, first: int, n_active: int, active: NDArray[np.uint32], waiting: NDArray[np.bool_]
) -> int:
    waiting[i] = True
    last = first + n_active
    active[last if last < active.shape[0] else last - active.shape[0]] = i
    return n_active + 1


@njit
def _augment(
    bridge: np.uint32,
    ends: NDArray[np.uint32],
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    parent: NDArray[np.uint32],
    orphans: NDArray[np.uint32],
) -> int:
    """Push what fits through the arc ``bridge`` from the source's tree to the sink's.

    The nodes that lose their parent are left in ``orphans``; how many they are is returned.
    """
    push = capacity[bridge]
    i = ends[bridge]
    while parent[i] != _ROOT:
        up = parent[i]
        if capacity[up ^ REVERSE] < push:
            push = capacity[up ^ REVERSE]
        i = ends[up ^ REVERSE]
    if excess[i] < push:
        push = excess[i]
    i = ends[bridge ^ REVERSE]
    while parent[i] != _ROOT:
        up = parent[i]
        if capacity[up] < push:
            push = capacity[up]
        i = ends[up ^ REVERSE]
    if -excess[i] < push:
        push = -excess[i]

    capacity[bridge] -= push
    capacity[bridge ^ REVERSE] += push
    n_orphans = 0
    i = ends[bridge]
    while parent[i] != _ROOT:
        up = parent[i]
        capacity[up] += push
        capacity[up ^ REVERSE] -= push
        if capacity[up ^ REVERSE] <= 0.0:
            parent[i] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = ends[up ^ REVERSE]
    excess[i] -= push
    if excess[i] <= 0.0:
        parent[i] = _ORPHAN
        orphans[n_orphans] = i
        n_orphans += 1
    i = ends[bridge ^ REVERSE]
    while parent[i] != _ROOT:
        up = parent[i]
        capacity[up] -= push
        capacity[up ^ REVERSE] += push
        if capacity[up] <= 0.0:
            parent[i] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = ends[up ^ REVERSE]
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
    start, head, arc, ends = arcs.start, arcs.head, arcs.arc, arcs.ends
    side, parent, stamp, depth = space.side, space.parent, space.stamp, space.depth
    active, waiting, orphans = space.active, space.waiting, space.orphans
    n_ring = orphans.shape[0]
    for k in range(n_orphans // 2):  # nearest to the roots first
        orphans[k], orphans[n_orphans - 1 - k] = orphans[n_orphans - 1 - k], orphans[k]
    done = 0
    while n_orphans > 0:
        i = orphans[done]
        done = done + 1 if done + 1 < n_ring else 0
        n_orphans -= 1
        tree = side[i]
        # Residuals count towards a node of the source's tree and away from one of the sink's.
        against = REVERSE if tree == SOURCE else FORTH
        best = _NONE
        best_depth = 2**31 - 1
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if side[j] == tree and capacity[arc[slot] ^ against] > 0.0:
                distance = _depth_if_rooted(j, clock, ends, parent, stamp, depth)
                if 0 < distance < best_depth:
                    best_depth = distance
                    best = arc[slot]
        if best != _NONE:
            parent[i] = best
            stamp[i] = clock
            depth[i] = best_depth + 1
            continue
        parent[i] = _NONE
        side[i] = FREE
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if side[j] == tree:
                if capacity[arc[slot] ^ against] > 0.0 and not waiting[j]:
                    n_active = _wake(j, first, n_active, active, waiting)
                if parent[j] == arc[slot] ^ REVERSE:
                    parent[j] = _ORPHAN
                    last = done + n_orphans
                    orphans[last if last < n_ring else last - n_ring] = j
                    n_orphans += 1
    return n_active


@njit
def _depth_if_rooted(
    i: np.uint32,
    clock: int,
    ends: NDArray[np.uint32],
    parent: NDArray[np.uint32],
    stamp: NDArray[np.int32],
    depth: NDArray[np.int32],
) -> int:
    """How far ``i`` is from its root, 0 if its path ends at an orphan; marks a sound path."""
    distance = 0
    j = i
    while stamp[j] != clock:
        up = parent[j]
        distance += 1
        if up == _ROOT:
            stamp[j] = clock
            depth[j] = 1
            break
        if up >= _ORPHAN:
            return 0
        j = ends[up ^ REVERSE]
    else:
        distance += depth[j]
    found = distance
    j = i
    while stamp[j] != clock:
        stamp[j] = clock
        depth[j] = distance
        distance -= 1
        j = ends[parent[j] ^ REVERSE]
    return found
