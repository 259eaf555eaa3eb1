"""Spatial context as features: the mean label histogram in windows around each cell."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError
from pgm_places.layout import GridLayout

__all__ = ["window_means"]


def window_means(
    layout: GridLayout,
    values: NDArray[np.float64],
    half_widths_m: Sequence[float],
    resolution_m: float,
) -> NDArray[np.float32]:
    """(N, W * K) means of node values over square windows centred at each node.

    Parameters
    ----------
    layout : GridLayout
        The cells that are nodes; only they are averaged over.
    values : (N, K) float
        For place labelling the histogram z of each cell.
    half_widths_m : sequence of W float
        Half the side of each window, in metres; rounded to whole cells, at least one.
    resolution_m : float
        Side of a cell.

    Columns are ordered by window, then by label. Sums come from integral images, so that the cost
    does not depend on the windows' size.
    """
    if values.ndim != 2 or len(values) != len(layout.cells_rc):
        raise InputError(f"values must have shape ({len(layout.cells_rc)}, K), got {values.shape}")
    radii = [max(1, round(width / resolution_m)) for width in half_widths_m]
    count = _integral(layout.to_raster(np.ones(len(values)), fill=0.0))
    means = np.empty((len(values), len(radii) * values.shape[1]), np.float32)
    weights = [_window_sums(count, layout.cells_rc, radius) for radius in radii]
    for k in range(values.shape[1]):
        sums = _integral(layout.to_raster(values[:, k], fill=0.0))
        for w, radius in enumerate(radii):
            total = _window_sums(sums, layout.cells_rc, radius)
            means[:, w * values.shape[1] + k] = total / weights[w]
    return means


def _integral(raster: NDArray[np.float64]) -> NDArray[np.float64]:
    padded = np.zeros((raster.shape[0] + 1, raster.shape[1] + 1))
    np.cumsum(np.cumsum(raster, axis=0), axis=1, out=padded[1:, 1:])
    return padded


def _window_sums(
    integral: NDArray[np.float64], cells_rc: NDArray[np.int32], radius: int
) -> NDArray[np.float64]:
    height, width = integral.shape[0] - 1, integral.shape[1] - 1
    low = np.maximum(cells_rc - radius, 0)
    high = np.minimum(cells_rc + radius + 1, [height, width])
    total: NDArray[np.float64] = (
        integral[high[:, 0], high[:, 1]]
        - integral[low[:, 0], high[:, 1]]
        - integral[high[:, 0], low[:, 1]]
        + integral[low[:, 0], low[:, 1]]
    )
    return total
