"""Kernels on the raster of a plan: its largest rectangles, and a robot's way from stop to stop."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["drive", "largest_rectangle", "steps_from"]


@njit
def largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """``x0, y0, x1, y1`` of the largest rectangle that lies in ``mask`` (H, W), ends excluded.

    For each row, the largest rectangle under the histogram of the columns' heights above it, by a
    stack of rising heights: O(H W). Of equal ones the first met wins, row by row.
    """
    height, width = mask.shape
    heights = np.zeros(width + 1, np.int64)  # the last stays 0 and ends every rectangle
    starts, stack = np.empty(width + 1, np.int64), np.empty(width + 1, np.int64)
    best, found = 0, (0, 0, 0, 0)
    for y in range(height):
        n_open = 0
        for x in range(width + 1):
            if x < width:
                heights[x] = heights[x] + 1 if mask[y, x] else 0
            start = x
            while n_open > 0 and stack[n_open - 1] >= heights[x]:
                n_open -= 1
                start = starts[n_open]
                area = stack[n_open] * (x - start)
                if area > best:
                    best, found = area, (start, y + 1 - stack[n_open], x, y + 1)
            starts[n_open], stack[n_open] = start, heights[x]
            n_open += 1
    return found


@njit
def _search(
    drivable: NDArray[np.bool_],
    wanted: NDArray[np.bool_],
    start: int,
    came_from: NDArray[np.int64],
    queue: NDArray[np.int64],
) -> tuple[int, int]:
    """The wanted cell that is reached in the fewest steps to the four sides, or -1.

    Also how many cells of ``queue`` were met: those of which ``came_from``, -1 before, was set.
    """
    height, width = drivable.shape
    came_from[start] = start
    queue[0] = start
    head, tail = 0, 1
    while head < tail:
        cell = queue[head]
        head += 1
        row, column = divmod(cell, width)
        if wanted[row, column]:
            return cell, tail
        for side in range(4):
            y = row + (side == 0) - (side == 1)
            x = column + (side == 2) - (side == 3)
            if 0 <= y < height and 0 <= x < width:
                other = y * width + x
                if drivable[y, x] and came_from[other] < 0:
                    came_from[other] = cell
                    queue[tail] = other
                    tail += 1
    return -1, tail


@njit
def drive(
    drivable: NDArray[np.bool_],
    stops: NDArray[np.bool_],
    start: int,
    spacing: int,
    out: NDArray[np.int64],
) -> int:
    """Cells every ``spacing`` steps of a way from stop to nearest stop, and how many there are.

    The way begins at the flat index ``start`` of ``drivable`` (H, W), the first of ``out``, and
    goes on while ``stops`` (H, W), which are taken out as they are reached, can be reached and
    ``out`` has space.
    """
    came_from = np.full(drivable.size, -1)
    queue = np.empty(drivable.size, np.int64)
    path = np.empty(drivable.size, np.int64)
    width = drivable.shape[1]
    out[0] = start
    n_out, driven, here = 1, 0, start
    while True:
        there, n_met = _search(drivable, stops, here, came_from, queue)
        if there < 0:
            return n_out
        stops[there // width, there % width] = False
        n_path, cell = 0, there
        while cell != here:
            path[n_path] = cell
            n_path += 1
            cell = came_from[cell]
        for met in queue[:n_met]:
            came_from[met] = -1
        for step in range(n_path - 1, -1, -1):
            driven += 1
            if driven % spacing == 0 or step == 0:
                if n_out == len(out):
                    return n_out
                out[n_out] = path[step]
                n_out += 1
        here = there


@njit
def steps_from(drivable: NDArray[np.bool_], start: int) -> NDArray[np.int64]:
    """(H, W) least steps to the four sides from a flat index, -1 where there is no way."""
    came_from = np.full(drivable.size, -1)
    queue = np.empty(drivable.size, np.int64)
    _, n_met = _search(drivable, np.zeros_like(drivable), start, came_from, queue)
    steps = np.full(drivable.size, -1, np.int64)
    steps[start] = 0
    for cell in queue[1:n_met]:
        steps[cell] = steps[came_from[cell]] + 1
    return steps.reshape(drivable.shape)
