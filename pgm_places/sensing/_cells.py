"""Arguments of kernels: the cells of scans, and the sensor's noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.sensing.sensor import SensorNoise


class Cells(NamedTuple):
    """The cells from which scans are cast."""

    rows: NDArray[np.int64]
    """(n,)."""
    columns: NDArray[np.int64]
    """(n,)."""
    nodes: NDArray[np.int32]
    """(n,) output row of each cell."""


class Noise(NamedTuple):
    """A :class:`~pgm_places.sensing.sensor.SensorNoise` for ``add_noise``."""

    seed_low: int
    """The lower 32 bits of the seed."""
    seed_high: int
    """The upper 32 bits of the seed."""
    sigma_m: float
    p_random: float
    p_max: float
    max_range_m: float

    @classmethod
    def of(cls, noise: SensorNoise, max_range_m: float) -> "Noise":
        """The noise of a sensor with a maximum range."""
        return cls(
            noise.seed & 0xFFFFFFFF,
            noise.seed >> 32,
            float(noise.sigma_m),
            float(noise.p_random),
            float(noise.p_max),
            float(max_range_m),
        )
