"""Connected components (Rosenfeld and Pfaltz, paper section 6.2), and distances to cells."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgm_places._checks import require_shape
from pgm_places._core import label_components, squared_distance
from pgm_places.errors import InputError
from pgm_places.graph.bands import bands_of_rows


def number_type(count: int) -> np.dtype[Any]:
    """The type that holds the numbers 0 to ``count`` and -1 for none.

    Examples
    --------
    >>> str(number_type(32_767)), str(number_type(32_768))
    ('int16', 'int32')
    """
    return np.dtype(np.int16 if count <= np.iinfo(np.int16).max else np.int32)


@dataclass(frozen=True, eq=False)
class Components:
    """The connected pieces of equal labels on a raster.

    Parameters
    ----------
    piece : (H, W) int32
        Number of each cell's piece, by first cells row by row from the bottom; -1 without a label.
    label : (R,) int32
    size : (R,) int64
        Cells of each piece.
    """

    piece: NDArray[np.int32]
    label: NDArray[np.int32]
    size: NDArray[np.int64]

    @property
    def count(self) -> int:
        """R, the number of pieces."""
        return len(self.label)

    @property
    def largest(self) -> NDArray[np.bool_]:
        """(H, W) the cells of the largest piece; of equals, the first."""
        number = self.size.argmax() if self.count else 0
        return np.asarray(self.piece == number)

    def on_cells(
        self, values: ArrayLike, fill: Any, *, out: NDArray[Any] | None = None
    ) -> NDArray[Any]:
        """(H, W) the value of each cell's piece (R,), or ``fill``; ``out`` may be ``piece``."""
        array = np.asarray(values)
        table = np.append(array, array.dtype.type(fill))  # index -1 is the last entry
        painted = np.empty(self.piece.shape, table.dtype) if out is None else out
        for rows in bands_of_rows(painted.shape):  # NumPy looks up by 64-bit copies of the numbers
            painted[rows] = table[self.piece[rows]]
        return painted

    def windows(self) -> list[tuple[slice, slice]]:
        """The bounding box of each piece, as slices of rows and columns."""
        from scipy.ndimage import find_objects

        return [(rows, columns) for rows, columns in find_objects(self.piece + 1)]


def connected_components(
    labels: NDArray[np.int16] | NDArray[np.int32] | NDArray[np.bool_], *, connectivity: int = 8
) -> Components:
    """The connected components of equal labels, in time linear in the cells.

    Parameters
    ----------
    labels : (H, W) int16, int32 or bool
        Label per cell, -1 for none; the cells of a mask have label 0.
    connectivity : {8, 4}
        8 connects cells that share a side or a corner, 4 only a side.

    Examples
    --------
    >>> found = connected_components(np.array([[0, 0, 1], [-1, 1, 1]], np.int16))
    >>> found.piece.tolist(), found.label.tolist(), found.size.tolist()
    ([[0, 0, 1], [-1, 1, 1]], [0, 1], [2, 3])
    """
    raster = np.asarray(labels)
    if raster.dtype == np.bool_:
        raster = raster.view(np.int8) - np.int8(1)
    if raster.ndim != 2 or not np.issubdtype(raster.dtype, np.integer):
        raise InputError(f"labels must be a 2-D integer raster, got {raster.dtype} {raster.shape}")
    if connectivity not in (4, 8):
        raise InputError(f"connectivity must be 4 or 8, got {connectivity}")
    dtype = raster.dtype if raster.dtype in (np.int8, np.int32) else np.int16
    values: NDArray[Any] = np.ascontiguousarray(raster, dtype)
    piece = np.empty(raster.shape, np.int32)
    scratch = np.empty(raster.size, np.int32)  # the system allocates only the pages in use
    count = label_components(values, connectivity == 8, scratch, piece)
    label, size = np.zeros(count, np.int32), np.zeros(count, np.int64)
    for rows in bands_of_rows(raster.shape):
        inside = piece[rows] >= 0
        numbers = piece[rows][inside]
        label[numbers] = values[rows][inside]
        size += np.bincount(numbers, minlength=count)
    return Components(piece, label, size)


def squared_clearance(
    blocked: NDArray[np.bool_], *, out: NDArray[np.int32] | None = None
) -> NDArray[np.int32]:
    """(H, W) squared distance, in cells, from each cell's centre to the nearest blocked one's.

    Everything outside the raster is blocked; blocked cells have distance 0. ``out`` (H, W) receives
    the result, to save memory on huge maps.

    Examples
    --------
    >>> squared_clearance(np.array([[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 1]], bool))[1].tolist()
    [1, 4, 1, 0]
    """
    targets = np.ascontiguousarray(blocked, np.bool_)
    squared = np.empty(targets.shape, np.int32) if out is None else out
    require_shape("out", squared.shape, targets.shape)
    if not targets.size:
        return squared
    width = targets.shape[1]
    site, start = np.empty(width, np.int32), np.empty(width, np.int32)
    squared_distance(targets, squared, site, start, np.empty(width, np.int64))
    return squared
