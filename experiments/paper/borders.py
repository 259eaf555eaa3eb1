"""The cells of a map that are not near a border between two true labels."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places.errors import InputError

SLACK = 1e-9  # in cells: a distance of exactly the tolerance counts as within it


def border_tolerant_mask(
    truth_raster: ArrayLike, resolution_m: float, *, tolerance_m: float = 0.3
) -> NDArray[np.bool_]:
    """(H, W) mask of the labelled cells farther than the tolerance from a true border.

    Where exactly a doorway ends is partly arbitrary; scores inside this mask do not depend on it. A
    border is where two cells with different labels are adjacent (8 neighbours), so a wall between
    two places is not a border. The distance of a cell is measured from its centre to the nearest
    cell at a border, plus half a cell.

    Parameters
    ----------
    truth_raster : (H, W) int
        True label index per cell, negative for none.
    resolution_m : float
        Side of a cell in metres.
    tolerance_m : float
        Half the width of the excluded strip, in metres.
    """
    from scipy.ndimage import distance_transform_edt

    truth = np.asarray(truth_raster)
    if truth.ndim != 2:
        raise InputError(f"truth_raster must be 2-D, got shape {truth.shape}")
    if resolution_m <= 0 or tolerance_m < 0:
        raise InputError(
            "resolution_m must be positive and tolerance_m at least 0, got "
            f"{resolution_m} and {tolerance_m}"
        )
    labelled = truth >= 0
    border = _border_cells(truth)
    if not border.any():
        return labelled
    cells = distance_transform_edt(~border)
    far: NDArray[np.bool_] = cells + 0.5 > tolerance_m / resolution_m + SLACK
    return labelled & far


def _border_cells(truth: NDArray[Any]) -> NDArray[np.bool_]:
    border = np.zeros(truth.shape, np.bool_)
    height, width = truth.shape
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        left, stop = max(0, -right), width - max(0, right)
        here = (slice(0, height - down), slice(left, stop))
        there = (slice(down, height), slice(left + right, stop + right))
        differ = (truth[here] != truth[there]) & (truth[here] >= 0) & (truth[there] >= 0)
        border[here] |= differ
        border[there] |= differ
    return border
