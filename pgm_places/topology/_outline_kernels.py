"""Outlines of pieces along the sides of their cells, and which of their vertices to drop."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

__all__ = ["simplify_arcs", "trace_rings"]

EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3
VERTEX = np.uint8(1)
NO_VERTEX = np.uint8(254)
DONE = np.uint8(2)


@njit
def _piece_at(piece: NDArray[np.int32], r: int, c: int) -> int:
    if r < 0 or c < 0 or r >= piece.shape[0] or c >= piece.shape[1]:
        return -1
    return int(piece[r, c])


@njit
def trace_rings(
    piece: NDArray[np.int32],
    visited: NDArray[np.bool_],
    points: NDArray[np.int32],
    is_fixed: NDArray[np.bool_],
    ring_start: NDArray[np.int32],
    ring_piece: NDArray[np.int32],
) -> int:
    """The number of rings; writes their vertices (row, column of cell corners) consecutively.

    A piece is to the left of its rings: outlines run counter-clockwise (x right, y up), holes
    clockwise. Where a piece touches itself at a corner, the ring follows the same cell. Vertices
    are turns and fixed points, where three pieces or two pairs meet. ``visited`` (H, W), False on
    entry, marks the cells whose lower side has been passed.
    """
    height, width = piece.shape
    n_rings = 0
    n_points = 0
    ring_start[0] = 0
    for r in range(height):
        for c in range(width):
            own = piece[r, c]
            if own < 0 or visited[r, c] or _piece_at(piece, r - 1, c) == own:
                continue
            y, x, heading = r, c, EAST
            while True:
                if heading == EAST:
                    if visited[y, x]:
                        break
                    visited[y, x] = True
                    x += 1
                elif heading == NORTH:
                    y += 1
                elif heading == WEST:
                    x -= 1
                else:
                    y -= 1
                low_left, low_right = _piece_at(piece, y - 1, x - 1), _piece_at(piece, y - 1, x)
                up_left, up_right = _piece_at(piece, y, x - 1), _piece_at(piece, y, x)
                if heading == EAST:
                    ahead_left, ahead_right = up_right, low_right
                elif heading == NORTH:
                    ahead_left, ahead_right = up_left, up_right
                elif heading == WEST:
                    ahead_left, ahead_right = low_left, up_left
                else:
                    ahead_left, ahead_right = low_right, low_left
                before = heading
                if ahead_left != own:
                    heading = (heading + 1) % 4
                elif ahead_right == own:
                    heading = (heading + 3) % 4
                # Two pieces meet along a line or at one corner; all else stays where it is.
                sides = (low_left != low_right) + (low_right != up_right)
                sides += (up_right != up_left) + (up_left != low_left)
                fixed = sides > 2
                if fixed or heading != before:
                    points[n_points, 0] = y
                    points[n_points, 1] = x
                    is_fixed[n_points] = fixed
                    n_points += 1
            ring_piece[n_rings] = own
            n_rings += 1
            ring_start[n_rings] = n_points
    return n_rings


@njit
def simplify_arcs(
    points: NDArray[np.int32],
    is_fixed: NDArray[np.bool_],
    ring_start: NDArray[np.int32],
    tolerance: float,
    state: NDArray[np.uint8],
    order: NDArray[np.int32],
) -> None:
    """Remove vertices from ``state`` (H + 1, W + 1), which is ``VERTEX`` at all of them.

    Between two fixed points, a border is one arc shared by two pieces and is simplified once. A
    vertex is removed only if the triangle with its neighbours contains no other vertex, so borders
    never cross, and if every removed vertex stays within ``tolerance`` (cells) of the new line.
    ``order`` is scratch, two longer than the longest ring.
    """
    for ring in range(len(ring_start) - 1):
        first, stop = ring_start[ring], ring_start[ring + 1]
        length = stop - first
        # Start at a fixed vertex, or else at the very first one, which is the same for both pieces.
        begin = first
        for i in range(first, stop):
            if is_fixed[i]:
                begin = i
                break
            earlier = points[i, 0] < points[begin, 0] or (
                points[i, 0] == points[begin, 0] and points[i, 1] < points[begin, 1]
            )
            if earlier:
                begin = i
        n = 0
        for step in range(length + 1):
            i = begin + step
            if i >= stop:
                i -= length
            order[n] = i
            n += 1
            if step > 0 and (is_fixed[i] or step == length):
                if n > 2 and not state[points[order[1], 0], points[order[1], 1]] & DONE:
                    _simplify_arc(points, order, n, tolerance, state)
                order[0] = i
                n = 1


@njit
def _simplify_arc(
    points: NDArray[np.int32],
    order: NDArray[np.int32],
    n: int,
    tolerance: float,
    state: NDArray[np.uint8],
) -> None:
    """Simplify one arc, keeping the vertex farthest from its chord so that it never vanishes."""
    for k in range(1, n - 1):
        state[points[order[k], 0], points[order[k], 1]] |= DONE
    begin, end = order[0], order[n - 1]
    closed = points[begin, 0] == points[end, 0] and points[begin, 1] == points[end, 1]
    middle = 0
    for turn in range(3):  # the whole arc, then each half of a ring
        first = middle if turn == 2 else 0
        last = middle if turn == 1 else n - 1
        farthest = _farthest(points, order, first, last)
        if closed and turn == 0:  # each half of a ring has to keep a vertex too
            middle = farthest
            continue
        for half in range(2):
            start, stop = (farthest, last) if half else (first, farthest)
            _thin_out(points, order, start, stop, tolerance, state)
        if not closed:
            break


@inlined
def _farthest(points: NDArray[np.int32], order: NDArray[np.int32], first: int, last: int) -> int:
    """The vertex farthest from the chord, or from the first vertex if the arc is closed."""
    ay, ax = np.int64(points[order[first], 0]), np.int64(points[order[first], 1])
    uy, ux = points[order[last], 0] - ay, points[order[last], 1] - ax
    best, most = first + 1, np.int64(-1)
    for k in range(first + 1, last):
        vy, vx = points[order[k], 0] - ay, points[order[k], 1] - ax
        distance = vy * vy + vx * vx
        if uy != 0 or ux != 0:
            distance = ux * vy - uy * vx
            distance = distance if distance > 0 else -distance
        if distance > most:
            best, most = k, distance
    return best


@inlined
def _thin_out(
    points: NDArray[np.int32],
    order: NDArray[np.int32],
    first: int,
    last: int,
    tolerance: float,
    state: NDArray[np.uint8],
) -> None:
    """Walk along an arc and drop vertices while the chord stays close to all it skips."""
    anchor, before = first, first + 1
    for k in range(first + 2, last + 1):
        close = _is_close(points, order, anchor, k, tolerance)
        if close and _is_empty(points, order[anchor], order[before], order[k], state):
            state[points[order[before], 0], points[order[before], 1]] &= NO_VERTEX
        else:
            anchor = before
        before = k


@inlined
def _is_close(
    points: NDArray[np.int32], order: NDArray[np.int32], first: int, last: int, tolerance: float
) -> bool:
    """Whether all vertices between are within the tolerance of the segment from first to last."""
    ay, ax = points[order[first], 0], points[order[first], 1]
    ux, uy = float(points[order[last], 1] - ax), float(points[order[last], 0] - ay)
    square = ux * ux + uy * uy
    for k in range(first + 1, last):
        vx, vy = float(points[order[k], 1] - ax), float(points[order[k], 0] - ay)
        t = (ux * vx + uy * vy) / square if square > 0.0 else 0.0
        t = t if t > 0.0 else 0.0
        t = t if t < 1.0 else 1.0
        dx, dy = vx - t * ux, vy - t * uy
        if not dx * dx + dy * dy <= tolerance * tolerance:
            return False
    return True


@njit
def _is_empty(points: NDArray[np.int32], a: int, b: int, c: int, state: NDArray[np.uint8]) -> bool:
    """Whether the triangle, including its sides, contains no vertex but its own corners."""
    ay, ax = np.int64(points[a, 0]), np.int64(points[a, 1])
    by, bx = np.int64(points[b, 0]), np.int64(points[b, 1])
    cy, cx = np.int64(points[c, 0]), np.int64(points[c, 1])
    if ax == cx and ay == cy:
        return False
    lowest, highest = (ay, by) if ay < by else (by, ay)
    lowest, highest = cy if cy < lowest else lowest, cy if cy > highest else highest
    for y in range(lowest, highest + 1):
        low, high = 1e18, -1e18
        y0, x0, y1, x1 = ay, ax, by, bx
        for _ in range(3):
            if (y0 <= y <= y1) or (y1 <= y <= y0):
                # a side along the row has both its ends as ends of the others
                x = x0 + (x1 - x0) * (y - y0) / (y1 - y0) if y0 != y1 else float(x0)
                low, high = x if x < low else low, x if x > high else high
            y0, x0, y1, x1 = y1, x1, ay + by + cy - y0 - y1, ax + bx + cx - x0 - x1
        for column in range(int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9)) + 1):
            own = (y == ay and column == ax) or (y == by and column == bx)
            own = own or (y == cy and column == cx)
            if not own and state[y, column] & VERTEX:
                return False
    return True
