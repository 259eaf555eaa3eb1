"""Cells near a line, slow and obvious: the distance of every cell around it."""

from collections.abc import Sequence

import numpy as np


def band(
    start: Sequence[float], end: Sequence[float], reach: float, shape: tuple[int, int]
) -> tuple[slice, slice, np.ndarray]:
    """Rows, columns and mask of the cells of a raster at most ``reach`` from a line."""
    ends = np.array([start, end])
    low = np.clip(np.floor(ends.min(axis=0) - reach), 0, shape).astype(int)
    high = np.clip(np.ceil(ends.max(axis=0) + reach) + 1, low, shape).astype(int)
    rows, columns = slice(low[0], high[0]), slice(low[1], high[1])
    y, x = np.mgrid[rows, columns]
    offset = np.stack([y, x], axis=-1) - ends[0]
    along = ends[1] - ends[0]
    share = np.clip(offset @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    away = offset - share[..., None] * along
    return rows, columns, (away**2).sum(axis=-1) <= reach**2
