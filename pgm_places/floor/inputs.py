"""What the network is told of each cell of 0.2 m."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["FARTHEST", "network_inputs", "open_cells"]

FARTHEST = 80
"""Cells of 0.1 m beyond which a distance says nothing more."""


def open_cells(
    free: NDArray[np.uint8], occupied: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Two masks (h, w), what is not occupied and what is free, whose depths the network sees."""
    return ~occupied, ~occupied & (free >= 128)


def network_inputs(
    free: NDArray[np.uint8],
    occupied: NDArray[np.bool_],
    depths: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> NDArray[np.float32]:
    """(h / 2, w / 2, 10) inputs from a raster (h, w) of 0.1 m, both even.

    For the four cells in each: the share that is free, and whether any part is occupied. For the
    first of them: ln(1 + d) / 2 of its depths d (h, w) in the masks of :func:`open_cells`, the
    distances to the nearest cell outside, in cells and at most 8 m.
    """
    return np.concatenate(
        [
            _four(free) / np.float32(255),
            _four(occupied).astype(np.float32),
            *(np.log1p(np.minimum(d[::2, ::2], FARTHEST))[..., None] / 2 for d in depths),
        ],
        axis=2,
        dtype=np.float32,
    )


def _four(values: NDArray[Any]) -> NDArray[Any]:
    """(h / 2, w / 2, 4) the four values in each block of two by two."""
    h, w = values.shape
    blocks = values.reshape(h // 2, 2, w // 2, 2).transpose(0, 2, 1, 3)
    return blocks.reshape(h // 2, w // 2, 4)
