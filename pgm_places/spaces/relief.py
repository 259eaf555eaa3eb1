"""The relief of a map: the distance of each open cell to the nearest wall, smoothed by one cell."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._core import smoothed_roots
from pgm_places.maps.clearance import squared_clearance

__all__ = ["UNIT", "clearance_m", "half_width_m", "relief_of"]

_ROOT_UNIT = 1024

UNIT = 9 * _ROOT_UNIT
"""The height that corresponds to one cell; reliefs are integers."""

_OFFSET = UNIT / 4
"""How much smoothing lowers the distance on the middle line of a passage, to within a twelfth of a
cell, whether the passage is an odd or an even number of cells wide."""


def relief_of(is_open: NDArray[np.bool_]) -> NDArray[np.int32]:
    """(H + 2, W + 2) smoothed distance to the nearest cell that is not open, with a frame of 0.

    The mean over 3 x 3 cells of the Euclidean distance between cell centres (Meijster, Roerdink and
    Hesselink, 2000), in units of 1 / ``UNIT`` cells; 0 exactly where a cell is not open. Cells
    outside the map are not open.

    Examples
    --------
    >>> (relief_of(np.ones((3, 3), np.bool_))[1:-1, 1:-1] / UNIT).round(2).tolist()
    [[0.56, 0.78, 0.56], [0.78, 1.11, 0.78], [0.56, 0.78, 0.56]]
    """
    height, width = is_open.shape
    relief = np.empty((height + 2, width + 2), np.int32)
    smoothed_roots(squared_clearance(~is_open), _ROOT_UNIT, relief)
    return relief


def half_width_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Half the width of the free space in metres at cells on its middle line, from their heights.

    ``(relief / UNIT + 1/4) resolution_m``: smoothing lowers the distance on the middle line of a
    passage by a quarter of a cell, to within a twelfth, whether the passage is an odd or an even
    number of cells wide. For cells beside the middle line see ``clearance_m``.
    """
    return np.asarray((np.asarray(relief, np.float64) + _OFFSET) * (resolution_m / UNIT))


def clearance_m(relief: ArrayLike, resolution_m: float) -> NDArray[np.float64]:
    """Distance in metres from cell centres to the edge of the nearest wall, from their heights.

    ``(relief / UNIT - 1/2) resolution_m``, at least 0; up to 3/4 of a cell less on the middle line
    of a passage, which smoothing lowers.
    """
    cells = np.asarray(relief, np.float64) / UNIT - 0.5
    return np.asarray(np.maximum(cells, 0.0) * resolution_m)
