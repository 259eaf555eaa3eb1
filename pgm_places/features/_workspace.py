"""The planes that one thread works in while it extracts features."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.features._fourier_kernels import SUM_ROWS, WORK_ROWS
from pgm_places.features._lone_scan_kernels import EXACT_ROWS, SINGLE_ROWS, VERTICES, LoneRoom
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

    @cached_property
    def lone(self) -> LoneRoom:
        """Room for the Fourier series of one scan alone."""
        powers = np.zeros((2 * LANES, VERTICES), np.float32)
        powers[0] = 1.0
        return LoneRoom(
            self.few,
            np.zeros((SUM_ROWS, LANES), np.float32),
            np.zeros((EXACT_ROWS, VERTICES + LANES)),
            np.zeros((SINGLE_ROWS, VERTICES + LANES), np.float32),
            powers,
            aligned_planes(2 * VERTICES, np.float32),
            aligned_planes(4 * 7, np.float32),
            np.arange(2 * VERTICES),
        )

    def block(self, dtype: Any) -> NDArray[Any]:
        """(16, 16) room for a block of scans of a type."""
        if dtype not in self._blocks:
            self._blocks[dtype] = aligned_planes(LANES, dtype)
        return self._blocks[dtype]
