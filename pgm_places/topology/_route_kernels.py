"""Straight edges over the cells of a raster: their clearance, their regions, and which are needed.

Positions are rows and columns in cells, integers being cell centres. A blocked cell is a square.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.topology._heap_kernels import pop, push, twice

__all__ = ["needed_edges", "segment_clearances", "stays_between"]


@njit
def segment_clearances(
    blocked: NDArray[np.bool_],
    ends: NDArray[np.float64],
    most: NDArray[np.float64],
    clearance: NDArray[np.float64],
) -> None:
    """The exact distance from each segment to the nearest blocked square, at most ``most``.

    ``ends`` (M, 4) are the rows and columns of both ends, inside a raster (H, W) whose edge is
    blocked; ``most`` (M,) and ``clearance`` (M,) are in cells.
    """
    height, width = blocked.shape
    for m in range(len(ends)):
        y0, x0, y1, x1 = ends[m, 0], ends[m, 1], ends[m, 2], ends[m, 3]
        best = most[m]
        top = max(int(np.ceil(min(y0, y1) - best - 0.5)), 0)
        bottom = min(int(np.floor(max(y0, y1) + best + 0.5)), height - 1)
        for r in range(top, bottom + 1):
            # The part of the segment that is near this row, and the columns that are near it.
            t0, t1 = 0.0, 1.0
            if y0 != y1:
                a, b = (r - best - 0.5 - y0) / (y1 - y0), (r + best + 0.5 - y0) / (y1 - y0)
                t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
            if t0 > t1:
                continue
            xa, xb = x0 + t0 * (x1 - x0), x0 + t1 * (x1 - x0)
            left = max(int(np.ceil(min(xa, xb) - best - 0.5)), 0)
            right = min(int(np.floor(max(xa, xb) + best + 0.5)), width - 1)
            for c in range(left, right + 1):
                if blocked[r, c]:
                    best = min(best, _to_square(y0 - r, x0 - c, y1 - r, x1 - c))
        clearance[m] = best


@fused
def _to_square(y0: float, x0: float, y1: float, x1: float) -> float:
    """Distance from a segment to the square of side 1 around the origin."""
    # What is left of the segment between the lines of the square's sides.
    t0, t1 = 0.0, 1.0
    for start, end in ((y0, y1), (x0, x1)):
        if start == end:
            if abs(start) > 0.5:
                t1 = -1.0
        else:
            a, b = (-0.5 - start) / (end - start), (0.5 - start) / (end - start)
            t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
    if t0 <= t1:
        return 0.0
    # Of two convex shapes that do not meet, a corner of one is nearest to the other.
    best = min(
        np.hypot(max(abs(y0) - 0.5, 0.0), max(abs(x0) - 0.5, 0.0)),
        np.hypot(max(abs(y1) - 0.5, 0.0), max(abs(x1) - 0.5, 0.0)),
    )
    dy, dx = y1 - y0, x1 - x0
    squared = dy * dy + dx * dx
    for y in (-0.5, 0.5):
        for x in (-0.5, 0.5):
            t = 0.0
            if squared > 0.0:
                t = min(max(((y - y0) * dy + (x - x0) * dx) / squared, 0.0), 1.0)
            best = min(best, np.hypot(y0 + t * dy - y, x0 + t * dx - x))
    return best


@njit
def stays_between(
    region: NDArray[np.int32], ends: NDArray[np.float64], stays: NDArray[np.bool_]
) -> None:
    """Which segments (M, 4) cross only cells of the two regions that they begin and end in."""
    for m in range(len(ends)):
        y0, x0, y1, x1 = ends[m, 0], ends[m, 1], ends[m, 2], ends[m, 3]
        first = region[int(np.floor(y0 + 0.5)), int(np.floor(x0 + 0.5))]
        last = region[int(np.floor(y1 + 0.5)), int(np.floor(x1 + 0.5))]
        n_steps = int(4 * max(abs(y1 - y0), abs(x1 - x0))) + 1
        stays[m] = True
        for step in range(n_steps + 1):
            t = step / n_steps
            r = int(np.floor(y0 + t * (y1 - y0) + 0.5))
            c = int(np.floor(x0 + t * (x1 - x0) + 0.5))
            if region[r, c] != first and region[r, c] != last:
                stays[m] = False
                break


@njit
def needed_edges(
    edges: NDArray[np.int64],
    length: NDArray[np.int64],
    stretch: float,
    n_nodes: int,
    needed: NDArray[np.bool_],
) -> None:
    """Which edges (M, 2) a graph needs so that no way in it is ``stretch`` times too long.

    The greedy spanner (Althöfer et al., 1993): ``edges`` come in order of their ``length`` (M,),
    and one is needed if no way over those before is at most ``stretch`` times as long.
    """
    first = np.full(n_nodes, -1, np.int64)
    following, to = np.empty(2 * len(edges), np.int64), np.empty(2 * len(edges), np.int64)
    total = np.full(n_nodes, -1, np.int64)
    touched, heap = np.empty(n_nodes, np.int64), np.empty(256, np.int64)
    for m in range(len(edges)):
        start, goal = edges[m, 0], edges[m, 1]
        limit = int(stretch * length[m])
        n_touched, total[start], touched[0] = 1, 0, start
        n = push(heap, 0, start)
        needed[m] = True
        while n:
            node = heap[0] % n_nodes
            here = heap[0] // n_nodes
            n = pop(heap, n)
            if node == goal:
                needed[m] = False
                break
            if here > total[node]:
                continue
            link = first[node]
            while link >= 0:
                other, new = to[link], here + length[link // 2]
                link = following[link]
                if new > limit or (total[other] >= 0 and new >= total[other]):
                    continue
                if total[other] < 0:
                    touched[n_touched] = other
                    n_touched += 1
                total[other] = new
                if n == len(heap):
                    heap = twice(heap)
                n = push(heap, n, new * n_nodes + other)
        for k in range(n_touched):
            total[touched[k]] = -1
        if needed[m]:
            to[2 * m], following[2 * m], first[start] = goal, first[start], 2 * m
            to[2 * m + 1], following[2 * m + 1], first[goal] = start, first[goal], 2 * m + 1
