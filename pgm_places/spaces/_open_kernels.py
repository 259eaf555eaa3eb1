"""Passes over the raster that count pieces and flip small ones."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["clear_small", "piece_sizes", "sides_of_value"]


@njit
def sides_of_value(cells: NDArray[np.int8], free: int, side: NDArray[np.int8]) -> None:
    """Write -1 for free cells and 0 for the others, the raster that pieces are searched in."""
    for r in range(cells.shape[0]):
        for c in range(cells.shape[1]):
            side[r, c] = -1 if cells[r, c] == free else 0


@njit
def piece_sizes(piece: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """(R,) cells of each piece of a raster, -1 for none."""
    size = np.zeros(count, np.int64)
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            if piece[r, c] >= 0:
                size[piece[r, c]] += 1
    return size


@njit
def clear_small(
    piece: NDArray[np.int32], size: NDArray[np.int64], least: float, side: NDArray[np.int8]
) -> None:
    """Swap the two sides, except for small pieces.

    Pieces are made of the cells where ``side`` is 0. Those of at least ``least`` cells become -1;
    smaller ones join the rest, which becomes 0.
    """
    for r in range(piece.shape[0]):
        for c in range(piece.shape[1]):
            number = piece[r, c]
            small = number >= 0 and size[number] < least
            side[r, c] = -1 if side[r, c] == 0 and not small else 0
