"""Thinning: cells are taken away in order of their clearance as long as nothing comes apart.

A cell may go if its neighbours stay connected without it and no hole opens (it is a simple point;
Yokoi's number of connectivity in the eight directions is one). Those nearest to a wall go first
(Pudney, 1998), so that what is left runs along the middle.
"""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import fused, njit
from pgm_places.topology._heap_kernels import pop, push, twice

__all__ = ["thin"]


@njit
def thin(
    inside: NDArray[np.bool_],
    clearance: NDArray[np.int32],
    is_kept: NDArray[np.bool_],
) -> None:
    """Take cells of ``inside`` (H, W) away until none can go.

    Nothing is inside along the edges of the raster. ``clearance`` (H, W) says which cells go first,
    by row and column where it is the same; cells of ``is_kept`` (H, W) never go.
    """
    height, width = inside.shape
    flat, order, kept = inside.ravel(), clearance.ravel(), is_kept.ravel()
    n_cells = height * width
    is_pending = np.zeros(n_cells, np.bool_)
    heap = np.empty(1024, np.int64)
    n = 0
    for cell in range(n_cells):
        if flat[cell] and not kept[cell] and _connectivity(flat, cell, width) == 1:
            if n == len(heap):
                heap = twice(heap)
            is_pending[cell] = True
            n = push(heap, n, order[cell] * n_cells + cell)
    while n:
        cell = heap[0] % n_cells
        n = pop(heap, n)
        is_pending[cell] = False
        if _connectivity(flat, cell, width) != 1:
            continue
        flat[cell] = False
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                other = cell + dr * width + dc
                if not flat[other] or kept[other] or is_pending[other]:
                    continue
                if n == len(heap):
                    heap = twice(heap)
                is_pending[other] = True
                n = push(heap, n, order[other] * n_cells + other)


@fused
def _connectivity(flat: NDArray[np.bool_], cell: int, width: int) -> int:
    """Yokoi's number in the eight directions: one for cells that may go."""
    east, west = flat[cell + 1], flat[cell - 1]
    south, north = flat[cell + width], flat[cell - width]
    number = 0
    if not east and (flat[cell - width + 1] or north):
        number += 1
    if not north and (flat[cell - width - 1] or west):
        number += 1
    if not west and (flat[cell + width - 1] or south):
        number += 1
    if not south and (flat[cell + width + 1] or east):
        number += 1
    return number
