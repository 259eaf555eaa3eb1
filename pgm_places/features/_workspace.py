"""The planes that one thread works in while it extracts features."""

import numpy as np

from pgm_places._core import fourier_rows
from pgm_places.features._tiles import N_BEAMS, N_FEATURES, SHAPE_ROWS, TILE_ROWS
from pgm_places.kernels.lanes import aligned_planes

__all__ = ["Workspace"]


class Workspace:
    """Planes for a number of tiles; a tenth of a megabyte for each and a little more.

    ``rho`` holds the beams, ``edges`` and ``shape`` what the polygon's kernels share, ``values``
    the features; the others are room for single kernels.
    """

    def __init__(self, n_tiles: int) -> None:
        self.rho = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.edges = aligned_planes(n_tiles * TILE_ROWS, np.float64)
        self.shape = aligned_planes(n_tiles * SHAPE_ROWS, np.float64)
        self.values = aligned_planes(n_tiles * N_FEATURES, np.float32)
        self.ahead = aligned_planes(N_BEAMS + 1, np.float64)
        self.kept = aligned_planes(N_BEAMS + 1, np.float64)
        self.series = aligned_planes(fourier_rows(), np.float32)
        self.beams = np.zeros(N_BEAMS + 1, np.int64)
