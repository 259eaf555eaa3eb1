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
from pgm_places.solvers._excess_kernels import push_between_neighbours, spread_excess

__all__ = [
    "FREE",
    "PATH_COLUMNS",
    "SINK",
    "SOURCE",
    "CutSpace",
    "minimum_cut_kernel",
    "parted_capacity",
]

FREE = 0
SOURCE = 1
SINK = 2

PATH_COLUMNS = 4
_ARC, _PARENT, _STAMP, _DEPTH = 0, 1, 2, 3

_NONE = np.uint32(2**32 - 1)
_ROOT = np.uint32(2**32 - 2)
_ORPHAN = np.uint32(2**32 - 3)
_ONE = np.uint32(1)
_SUMMED_AT_ONCE = 4096
"""Sums of sums round less than one long sum."""
_NEAR = np.uint32(2)
"""An orphan that finds a parent so near to the root looks no further."""


class CutSpace(NamedTuple):
    """Working arrays of one minimum cut, to be reused for the next; ``side`` is its result."""

    side: NDArray[np.int8]
    """(N,) tree of each node."""
    path: NDArray[np.uint32]
    """(N, 4) the path to the root, side by side as walks along it need them: the arc that leads to
    the parent or one of the marks above all arcs, the parent, when the path was last known to be
    sound, its length."""
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
    the sink, ``capacity`` is per arc; both end as residuals. Arrays may be longer than needed; the
    arcs' ``ends`` are not looked at.
    """
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, path = space.side, space.path
    active, waiting = space.active, space.waiting
    n_ring = active.shape[0]
    spread_excess(n_nodes, arcs, excess, capacity)
    push_between_neighbours(n_nodes, arcs, excess, capacity)
    n_active = _plant(n_nodes, arcs, excess, capacity, space)
    first = 0
    clock = np.uint32(0)
    going_on = False
    i = np.uint32(0)
    slot = np.uint32(0)
    while True:
        if not going_on:
            if n_active == 0:
                return
            i = active[first]
            first = first + 1 if first + 1 < n_ring else 0
            n_active -= 1
            waiting[i] = False
            if side[i] == FREE:
                continue
            slot = start[i]
        grown = side[i]
        against = REVERSE if grown == SINK else FORTH
        bridge = _NONE
        beyond = np.uint32(0)
        while slot < start[i + _ONE]:
            j = head[slot]
            if side[j] != grown and capacity[arc[slot] ^ against] > 0.0:
                if side[j] != FREE:
                    bridge = np.uint32(arc[slot] ^ against)
                    beyond = j
                    break
                side[j] = grown
                path[j, _ARC] = arc[slot] ^ REVERSE
                path[j, _PARENT] = i
                path[j, _STAMP] = path[i, _STAMP]
                path[j, _DEPTH] = path[i, _DEPTH] + _ONE
                if not waiting[j]:
                    n_active = _wake(j, first, n_active, active, waiting)
            slot += _ONE
        going_on = bridge != _NONE
        if going_on:
            clock += _ONE
            tail, tip = (i, beyond) if grown == SOURCE else (beyond, i)
            n_orphans = _augment(bridge, tail, tip, excess, capacity, path, space.orphans)
            n_active = _adopt(n_orphans, clock, first, n_active, arcs, capacity, space)
            # What it has passed is in its tree or cut off, and wakes it if it is set free.
            going_on = side[i] == grown


@njit
def _plant(
    n_nodes: int,
    arcs: Arcs,
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    space: CutSpace,
) -> int:
    """Make a root of every node that is joined to a terminal; how many of them can grow."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, path = space.side, space.path
    for i in range(n_nodes):
        side[i] = SOURCE if excess[i] > 0.0 else (SINK if excess[i] < 0.0 else FREE)
        path[i, _ARC] = _ROOT if side[i] != FREE else _NONE
        path[i, _STAMP] = 0
        path[i, _DEPTH] = 1
    n_active = 0
    for i in range(n_nodes):
        against = REVERSE if side[i] == SINK else FORTH
        can_grow = False
        for slot in range(start[i], start[i + 1]):  # no branches: they could not be foreseen
            open_arc = capacity[arc[slot] ^ against] > 0.0
            can_grow |= open_arc & (side[head[slot]] != side[i])
        can_grow &= side[i] != FREE
        space.waiting[i] = can_grow
        space.active[n_active] = i
        n_active += can_grow
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
    tail: np.uint32,
    tip: np.uint32,
    excess: NDArray[np.float64],
    capacity: NDArray[np.float64],
    path: NDArray[np.uint32],
    orphans: NDArray[np.uint32],
) -> int:
    """Push what fits through the arc ``bridge`` from ``tail`` at the source to ``tip`` at the sink.

    The nodes that lose their parent are left in ``orphans``; how many they are is returned.
    """
    push = capacity[bridge]
    i = tail
    while path[i, _ARC] != _ROOT:
        push = min(push, capacity[path[i, _ARC] ^ REVERSE])
        i = path[i, _PARENT]
    push = min(push, excess[i])
    i = tip
    while path[i, _ARC] != _ROOT:
        push = min(push, capacity[path[i, _ARC]])
        i = path[i, _PARENT]
    push = min(push, -excess[i])

    capacity[bridge] -= push
    capacity[bridge ^ REVERSE] += push
    n_orphans = 0
    i = tail
    while path[i, _ARC] != _ROOT:
        up, parent = path[i, _ARC], path[i, _PARENT]
        capacity[up] += push
        capacity[up ^ REVERSE] -= push
        if capacity[up ^ REVERSE] <= 0.0:
            path[i, _ARC] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = parent
    excess[i] -= push
    if excess[i] <= 0.0:
        path[i, _ARC] = _ORPHAN
        orphans[n_orphans] = i
        n_orphans += 1
    i = tip
    while path[i, _ARC] != _ROOT:
        up, parent = path[i, _ARC], path[i, _PARENT]
        capacity[up] -= push
        capacity[up ^ REVERSE] += push
        if capacity[up] <= 0.0:
            path[i, _ARC] = _ORPHAN
            orphans[n_orphans] = i
            n_orphans += 1
        i = parent
    excess[i] += push
    if excess[i] >= 0.0:
        path[i, _ARC] = _ORPHAN
        orphans[n_orphans] = i
        n_orphans += 1
    return n_orphans


@njit
def _adopt(
    n_orphans: int,
    clock: np.uint32,
    first: int,
    n_active: int,
    arcs: Arcs,
    capacity: NDArray[np.float64],
    space: CutSpace,
) -> int:
    """Find every orphan a new parent in its tree or set it free; the new number of active."""
    start, head, arc = arcs.start, arcs.head, arcs.arc
    side, path = space.side, space.path
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
        parent = np.uint32(0)
        best_depth = _NONE
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if side[j] != tree or not capacity[arc[slot] ^ against] > 0.0:
                continue
            if path[j, _DEPTH] >= best_depth:
                continue  # it may have come nearer since, but that is too rare to be looked up
            distance = _depth_if_rooted(j, clock, path)
            if 0 < distance < best_depth:
                best_depth = distance
                best = arc[slot]
                parent = j
                if distance <= _NEAR:
                    break
        if best != _NONE:
            path[i, _ARC] = best
            path[i, _PARENT] = parent
            path[i, _STAMP] = clock
            path[i, _DEPTH] = best_depth + _ONE
            continue
        path[i, _ARC] = _NONE
        side[i] = FREE
        for slot in range(start[i], start[i + _ONE]):
            j = head[slot]
            if side[j] == tree:
                if capacity[arc[slot] ^ against] > 0.0 and not waiting[j]:
                    n_active = _wake(j, first, n_active, active, waiting)
                if path[j, _ARC] == arc[slot] ^ REVERSE:
                    path[j, _ARC] = _ORPHAN
                    last = done + n_orphans
                    orphans[last if last < n_ring else last - n_ring] = j
                    n_orphans += 1
    return n_active


@njit
def _depth_if_rooted(i: np.uint32, clock: np.uint32, path: NDArray[np.uint32]) -> np.uint32:
    """How far ``i`` is from its root, 0 if its path ends at an orphan; marks a sound path."""
    distance = np.uint32(0)
    j = i
    while path[j, _STAMP] != clock:
        up = path[j, _ARC]
        distance += _ONE
        if up == _ROOT:
            path[j, _STAMP] = clock
            path[j, _DEPTH] = 1
            break
        if up >= _ORPHAN:
            return np.uint32(0)
        j = path[j, _PARENT]
    else:
        distance += path[j, _DEPTH]
    found = distance
    j = i
    while path[j, _STAMP] != clock:
        path[j, _STAMP] = clock
        path[j, _DEPTH] = distance
        distance -= _ONE
        j = path[j, _PARENT]
    return found


@njit
def parted_capacity(
    edges: NDArray[np.int32],
    inside: NDArray[np.bool_],
    forward: NDArray[np.float64],
    backward: NDArray[np.float64],
) -> float:
    """The sum of the capacities (E,) that lead from nodes inside to nodes that are not."""
    total = 0.0
    for block in range(0, edges.shape[0], _SUMMED_AT_ONCE):
        part = 0.0
        for e in range(block, min(block + _SUMMED_AT_ONCE, edges.shape[0])):
            first, second = inside[edges[e, 0]], inside[edges[e, 1]]
            if first != second:
                part += forward[e] if first else backward[e]
        total += part
    return total
