"""A raster bent as a map is when its mapper closes a loop."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T", bound=np.generic)


def bent(raster: NDArray[T], most: int, outside: int) -> NDArray[T]:
    """The first column stays and the last moves up by ``most`` cells, the more the farther on.

    Rows move to the right by up to half of that.
    """
    height, width = raster.shape
    up = np.rint(most * (np.arange(width + most) / width) ** 2).astype(int)
    right = np.rint(most / 2 * np.arange(height + most) / height).astype(int)
    rows = np.arange(height + most)[:, np.newaxis] - up
    columns = np.arange(width + most) - right[:, np.newaxis]
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    found = np.full(rows.shape, outside, raster.dtype)
    found[inside] = raster[rows[inside], columns[inside]]
    return found
