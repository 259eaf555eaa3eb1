"""Connected components in two passes over the raster (Rosenfeld and Pfaltz, 1966)."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["label_components"]


@njit
def label_components(
    labels: NDArray[np.int32] | NDArray[np.int16] | NDArray[np.int8],
    eight: bool,
    parent: NDArray[np.int32],
    piece: NDArray[np.int32],
) -> int:
    """Number of pieces; writes the piece of each cell, -1 where the label is negative.

    ``parent`` is scratch for one entry per provisional number, at most one per cell. Pieces are
    numbered in the order of their first cell, because a root is the smallest of its numbers.
    """
    height, width = labels.shape
    count = 0
    for r in range(height):
        for c in range(width):
            label = labels[r, c]
            if label < 0:
                piece[r, c] = -1
                continue
            own = -1
            if c > 0 and labels[r, c - 1] == label:
                own = piece[r, c - 1]
            if r > 0:
                first = c - 1 if eight and c > 0 else c
                last = c + 1 if eight and c + 1 < width else c
                for d in range(first, last + 1):
                    if labels[r - 1, d] != label or piece[r - 1, d] == own:
                        continue
                    if own < 0:
                        own = piece[r - 1, d]
                        continue
                    a = own
                    while parent[a] != a:
                        parent[a] = parent[parent[a]]
                        a = parent[a]
                    b = piece[r - 1, d]
                    while parent[b] != b:
                        parent[b] = parent[parent[b]]
                        b = parent[b]
                    own, other = (a, b) if a < b else (b, a)
                    parent[other] = own
            if own < 0:
                own = count
                parent[count] = count
                count += 1
            piece[r, c] = own
    n_pieces = 0
    for number in range(count):
        if parent[number] == number:
            parent[number] = n_pieces
            n_pieces += 1
        else:
            parent[number] = parent[parent[number]]
    for r in range(height):
        for c in range(width):
            if piece[r, c] >= 0:
                piece[r, c] = parent[piece[r, c]]
    return n_pieces
