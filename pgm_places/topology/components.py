"""Connected components of equal labels (Rosenfeld and Pfaltz, paper section 6.2)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgm_places.errors import InputError

__all__ = ["Components", "connected_components"]

EIGHT = np.ones((3, 3), np.bool_)
FOUR = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.bool_)


@dataclass(frozen=True, eq=False)
class Components:
    """The pieces that equal labels form on a raster.

    Parameters
    ----------
    piece : (H, W) int32
        Number of the piece that each cell lies in, -1 where there is no label. Pieces are numbered
        in the order of their first cell, row by row from the bottom.
    label : (R,) int16
        Label of each piece.
    size : (R,) int64
        Cells of each piece.
    """

    piece: NDArray[np.int32]
    label: NDArray[np.int16]
    size: NDArray[np.int64]

    @property
    def count(self) -> int:
        """R, the number of pieces."""
        return len(self.label)


def connected_components(labels: NDArray[np.int16], *, connectivity: int = 8) -> Components:
    """The connected components of equal labels, in time linear in the cells.

    Parameters
    ----------
    labels : (H, W) int
        Label per cell, -1 for none.
    connectivity : {8, 4}
        Whether cells that share only a corner belong together.

    Examples
    --------
    >>> found = connected_components(np.array([[0, 0, 1], [-1, 1, 1]], np.int16))
    >>> found.piece.tolist(), found.label.tolist(), found.size.tolist()
    ([[0, 0, 1], [-1, 1, 1]], [0, 1], [2, 3])
    """
    from scipy.ndimage import label as label_pieces

    raster = np.asarray(labels)
    if raster.ndim != 2 or not np.issubdtype(raster.dtype, np.integer):
        raise InputError(f"labels must be a 2-D integer raster, got {raster.dtype} {raster.shape}")
    if connectivity not in (4, 8):
        raise InputError(f"connectivity must be 4 or 8, got {connectivity}")
    structure = EIGHT if connectivity == 8 else FOUR
    piece = np.full(raster.shape, -1, np.int32)
    count = 0
    for value in range(int(raster.max(initial=-1)) + 1):
        mask = raster == value
        found = np.empty(raster.shape, np.int32)
        n_found = label_pieces(mask, structure, output=found)
        piece[mask] = found[mask] + (count - 1)
        count += int(n_found)
    return _numbered_by_first_cell(raster, piece, count)


def _numbered_by_first_cell(
    raster: NDArray[np.int16], piece: NDArray[np.int32], count: int
) -> Components:
    """Pieces renumbered by their first cell, so that numbers do not depend on the labels' order."""
    flat = piece.ravel()
    first = np.full(count, flat.size, np.int64)
    inside = np.flatnonzero(flat >= 0)
    # Written backwards, the smallest index of each piece is written last.
    first[flat[inside[::-1]]] = inside[::-1]
    order = np.argsort(first)
    number = np.empty(count, np.int32)
    number[order] = np.arange(count, dtype=np.int32)
    renumbered = piece.copy()
    renumbered.ravel()[inside] = number[flat[inside]]
    size = np.bincount(renumbered.ravel()[inside], minlength=count).astype(np.int64)
    label = raster.ravel()[first[order]].astype(np.int16)
    return Components(renumbered, label, size)
