"""Cells that scans are taken from, and the noise of their sensor, as kernels take them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.sensing.sensor import SensorNoise


class Cells(NamedTuple):
    """Cells that scans are taken from."""

    rows: NDArray[np.int64]
    """(n,)."""
    columns: NDArray[np.int64]
    """(n,)."""
    nodes: NDArray[np.int32]
    """(n,) row of the output of each."""


class Noise(NamedTuple):
    """A :class:`~pgm_places.sensing.sensor.SensorNoise` for ``add_noise``."""

    seed_low: int
    """The lower 32 bits of the seed,"""
    seed_high: int
    """and the upper ones."""
    sigma_m: float
    p_random: float
    p_max: float
    max_range_m: float

    @classmethod
    def of(cls, noise: SensorNoise, max_range_m: float) -> "Noise":
        """The noise of a sensor of that maximum range."""
        return cls(
            noise.seed & 0xFFFFFFFF,
            noise.seed >> 32,
            float(noise.sigma_m),
            float(noise.p_random),
            float(noise.p_max),
            float(max_range_m),
        )
