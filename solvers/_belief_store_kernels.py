"""The beliefs of a raster's nodes in a compact store.

Only the parts of the raster that contain nodes are stored: blocks of ``BLOCK`` cells in a row, with
the blocks around them so that every neighbour has a place. Cells that are not nodes have belief 0,
which the multiplicative update preserves, so no mask is needed and whole blocks are updated.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import inlined, njit

BLOCK = 16  # cells: one cache line of float32, one to four vectors


@inlined
def _cell_at(index: NDArray[np.int32], row: int, column: int) -> np.int64:
    """Where a cell of the raster lies in the store."""
    return BLOCK * np.int64(index[row + 1, column // BLOCK + 1]) + column % BLOCK


@njit
def place(
    beliefs: NDArray[np.float64],
    cells: NDArray[np.int32],
    index: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:
    """Write node beliefs (n, K) into the store ``out`` (K, M)."""
    for i in range(cells.shape[0]):
        row, column = cells[i, 0], cells[i, 1]
        at = _cell_at(index, row, column)
        for k in range(beliefs.shape[1]):
            out[k, at] = beliefs[i, k]


@njit
def collect(
    store: NDArray[np.float32],
    cells: NDArray[np.int32],
    index: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:
    """Read node beliefs (n, K) from the store (K, M), each row normalised once more."""
    for i in range(cells.shape[0]):
        row, column = cells[i, 0], cells[i, 1]
        at = _cell_at(index, row, column)
        total = 0.0
        for k in range(out.shape[1]):
            total += np.float64(store[k, at])
        for k in range(out.shape[1]):
            out[i, k] = np.float64(store[k, at]) / total


@njit
def code_walls(
    walls: NDArray[np.bool_],
    cells: NDArray[np.int32],
    index: NDArray[np.int32],
    by_direction: bool,
    out: NDArray[np.uint8],
) -> None:
    """Write which neighbours of each node are walls: a bit per direction, or two counts.

    The counts are of walls that share a side (low four bits) and a corner (high four bits).
    """
    height, width = walls.shape
    for i in range(cells.shape[0]):
        row, column = cells[i, 0], cells[i, 1]
        code = 0
        direction = 0
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                if dr == 0 and dc == 0:
                    continue
                r, c = row + dr, column + dc
                if 0 <= r < height and 0 <= c < width and walls[r, c]:
                    if by_direction:
                        code += 1 << direction
                    else:
                        code += 1 if dr == 0 or dc == 0 else 16
                direction += 1
        at = _cell_at(index, row, column)
        out[at] = code
