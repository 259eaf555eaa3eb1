"""The planes that one thread works in while it extracts features."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.features._fourier_kernels import SUM_ROWS, WORK_ROWS
from pgm_places.features._polygon_kernels import SHAPE_ROWS
from pgm_places.features._tiles import N_BEAMS, N_FEATURES, TILE_ROWS
from pgm_places.kernels.lanes import LANES, aligned_planes

__all__ = ["Workspace"]


class Workspace:
    """Planes for a number of tiles; a tenth of a megabyte for each and a little more.

    ``rho`` holds the beams, ``edges`` and ``shape`` what the polygon's kernels share, ``values``
    the features; the others are room for single kernels. ``calls`` are what fills ``values``, ready
    to be made again, for the plan and the number of tiles that ``calls_for`` holds.
    """

    def __init__(self, n_tiles: int) -> None:
        self.rho = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.edges = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.shape = aligned_planes(n_tiles * SHAPE_ROWS, np.float64)
        self.values = aligned_planes(n_tiles * N_FEATURES, np.float32)
        self.ahead = aligned_planes(N_BEAMS + 1, np.float64)
        self.kept = aligned_planes(N_BEAMS + 1, np.float64)
        self.few = aligned_planes(8, np.float64)
        self.outline = aligned_planes(WORK_ROWS, np.float32)
        self.cells = aligned_planes(SUM_ROWS, np.float32)
        self.rows = np.tile(np.arange(LANES), 2)
        self.places = np.arange(LANES)
        self.beams = np.zeros(N_BEAMS + 1, np.intp)
        self.calls_for: Any = None
        self.calls: list[Callable[[], None]] = []
        self._blocks: dict[Any, NDArray[Any]] = {}

    def block(self, dtype: Any) -> NDArray[Any]:
        """(16, 16) room for a block of scans of a type."""
        if dtype not in self._blocks:
            self._blocks[dtype] = aligned_planes(LANES, dtype)
        return self._blocks[dtype]
