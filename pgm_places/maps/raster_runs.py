"""A raster as runs of equal values: rasters of few large pieces take next to nothing."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgm_places.graph.bands import bands_of_rows

__all__ = ["RasterRuns"]


@dataclass(frozen=True, eq=False)
class RasterRuns:
    """The values of a raster, row after row, each with the cells in a row that have it.

    Parameters
    ----------
    shape : (int, int)
    dtype : dtype
    bands : tuple of pairs of (M,) arrays
        Values and lengths of the runs in each band of rows.

    Examples
    --------
    >>> runs = RasterRuns.of(np.array([[1, 1, 1], [1, 2, 2]], np.int16))
    >>> [values.tolist() for values, _ in runs.bands], runs.raster().tolist()
    ([[1, 2]], [[1, 1, 1], [1, 2, 2]])
    """

    shape: tuple[int, int]
    dtype: np.dtype[Any]
    bands: tuple[tuple[NDArray[Any], NDArray[np.int32]], ...]

    @classmethod
    def of(cls, raster: NDArray[Any]) -> Self:
        """The runs of a raster (H, W)."""
        shape = (raster.shape[0], raster.shape[1])
        return cls(
            shape, raster.dtype, tuple(_runs(raster[rows].ravel()) for rows in bands_of_rows(shape))
        )

    def raster(self) -> NDArray[Any]:
        """(H, W) the raster, a new one each time."""
        raster_of_runs = np.empty(self.shape, self.dtype)
        for rows, (values, lengths) in zip(bands_of_rows(self.shape), self.bands, strict=True):
            raster_of_runs[rows] = np.repeat(values, lengths).reshape(-1, self.shape[1])
        return raster_of_runs


def _runs(flat: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int32]]:
    starts = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    starts = np.concatenate([[0], starts])
    return flat[starts], np.diff(starts, append=len(flat)).astype(np.int32)
