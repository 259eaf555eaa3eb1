"""Outlines of pieces along the sides of their cells, and vertices that they can do without."""

import numpy as np
from numpy.typing import NDArray

from pgm_places._jit import njit

__all__ = ["count_sides", "simplify_arcs", "trace_rings"]

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
def count_sides(piece: NDArray[np.int32]) -> int:
    """Number of sides between a piece and something else, seen from the piece."""
    height, width = piece.shape
    count = 0
    for r in range(height):
        for c in range(width):
            own = piece[r, c]
            if own >= 0:
                count += r == 0 or piece[r - 1, c] != own
                count += r == height - 1 or piece[r + 1, c] != own
                count += c == 0 or piece[r, c - 1] != own
                count += c == width - 1 or piece[r, c + 1] != own
    return count


@njit
def trace_rings(
    piece: NDArray[np.int32],
    visited: NDArray[np.bool_],
    points: NDArray[np.int32],
    is_fixed: NDArray[np.bool_],
    ring_start: NDArray[np.int32],
    ring_piece: NDArray[np.int32],
) -> int:
    """Number of rings; writes their vertices (row, column of cell corners) one after the other.

    A piece lies to the left of its rings: outlines run counter-clockwise (x right, y up), holes
    clockwise. Where a piece touches itself at a corner, the ring stays at the same cell. Vertices
    are the turns and the fixed points, where three pieces or two pairs meet. ``visited`` (H, W) is
    False on entry: whether the lower side of a cell has been passed.
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
    """Remove vertices from ``state`` (H + 1, W + 1), which holds ``VERTEX`` at all of them.

    Between two fixed points a border is one arc, which two pieces share; it is simplified once. A
    vertex goes only if the triangle that it leaves holds no other vertex, so borders never come to
    cross; and every vertex that has gone lies within ``tolerance`` (cells) of what replaced it.
    ``order`` is scratch, as long as the longest ring and two more.
    """
    for ring in range(len(ring_start) - 1):
        first, stop = ring_start[ring], ring_start[ring + 1]
        length = stop - first
        # Start at a fixed vertex, else at the first one of all, the same for both pieces.
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
    """Simplify one arc; it keeps the vertex farthest from its chord, so that it never vanishes."""
    for k in range(1, n - 1):
        state[points[order[k], 0], points[order[k], 1]] |= DONE
    middle = _farthest(points, order, 0, n - 1)
    closed = (
        points[order[0], 0] == points[order[n - 1], 0]
        and points[order[0], 1] == points[order[n - 1], 1]
    )
    if closed:  # each half of a ring has to keep a vertex too
        for first, last in ((0, middle), (middle, n - 1)):
            if last - first > 1:
                half = _farthest(points, order, first, last)
                _thin_out(points, order, first, half, tolerance, state)
                _thin_out(points, order, half, last, tolerance, state)
    else:
        _thin_out(points, order, 0, middle, tolerance, state)
        _thin_out(points, order, middle, n - 1, tolerance, state)


@njit
def _farthest(points: NDArray[np.int32], order: NDArray[np.int32], first: int, last: int) -> int:
    """The vertex farthest from the chord, from the first vertex where the arc is closed."""
    ay, ax = np.int64(points[order[first], 0]), np.int64(points[order[first], 1])
    cy, cx = np.int64(points[order[last], 0]), np.int64(points[order[last], 1])
    closed = ay == cy and ax == cx
    best, most = first + 1, np.int64(-1)
    for k in range(first + 1, last):
        by, bx = np.int64(points[order[k], 0]), np.int64(points[order[k], 1])
        if closed:
            distance = (by - ay) ** 2 + (bx - ax) ** 2
        else:
            distance = abs((cx - ax) * (by - ay) - (cy - ay) * (bx - ax))
        if distance > most:
            best, most = k, distance
    return best


@njit
def _thin_out(
    points: NDArray[np.int32],
    order: NDArray[np.int32],
    first: int,
    last: int,
    tolerance: float,
    state: NDArray[np.uint8],
) -> None:
    """Walk along an arc and drop vertices as long as the chord stays close to all it skips."""
    anchor, before = first, first + 1
    for k in range(first + 2, last + 1):
        a, b, c = order[anchor], order[before], order[k]
        close = True
        for j in range(anchor + 1, k):
            if not _is_close(points, a, c, order[j], tolerance):
                close = False
                break
        if close and _is_empty(points, a, b, c, state):
            state[points[b, 0], points[b, 1]] &= NO_VERTEX
        else:
            anchor = before
        before = k


@njit
def _is_close(points: NDArray[np.int32], a: int, c: int, j: int, tolerance: float) -> bool:
    """Whether vertex j lies within the tolerance of the segment from a to c."""
    ux, uy = float(points[c, 1] - points[a, 1]), float(points[c, 0] - points[a, 0])
    vx, vy = float(points[j, 1] - points[a, 1]), float(points[j, 0] - points[a, 0])
    square = ux * ux + uy * uy
    t = 0.0
    if square > 0.0:
        t = min(max((ux * vx + uy * vy) / square, 0.0), 1.0)
    dx, dy = vx - t * ux, vy - t * uy
    return dx * dx + dy * dy <= tolerance * tolerance


@njit
def _is_empty(points: NDArray[np.int32], a: int, b: int, c: int, state: NDArray[np.uint8]) -> bool:
    """Whether the triangle holds no vertex but its own corners, its sides included."""
    ys = (points[a, 0], points[b, 0], points[c, 0])
    xs = (points[a, 1], points[b, 1], points[c, 1])
    if xs[0] == xs[2] and ys[0] == ys[2]:
        return False
    for y in range(min(ys), max(ys) + 1):
        low, high = 1e18, -1e18
        for side in range(3):
            y0, x0, y1, x1 = ys[side], xs[side], ys[(side + 1) % 3], xs[(side + 1) % 3]
            if y < min(y0, y1) or y > max(y0, y1):
                continue
            if y0 == y1:
                low, high = min(low, min(x0, x1)), max(high, max(x0, x1))
            else:
                x = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
                low, high = min(low, x), max(high, x)
        for column in range(int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9)) + 1):
            own = False
            for corner in range(3):
                own = own or (ys[corner] == y and xs[corner] == column)
            if not own and state[y, column] & VERTEX:
                return False
    return True
