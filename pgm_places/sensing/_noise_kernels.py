"""Sensor noise as a function of seed, cell and beam: no generator's state, so no order either."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit
from pgm_places.sensing._dda_kernels import Cells
from pgm_places.sensing.sensor import SensorNoise

__all__ = ["Noise", "add_noise"]

_WORD = 0xFFFFFFFF  # arithmetic is on 32-bit words held in larger integers


class Noise(NamedTuple):
    """A :class:`~pgm_places.sensing.sensor.SensorNoise` as kernels take it."""

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


@njit
def _mixed(word: int) -> int:
    """A bijection of 32-bit words whose output bits all depend on all input bits (C. Wellons)."""
    word ^= word >> 16
    word = (word * 0x21F0AAAD) & _WORD
    word ^= word >> 15
    word = (word * 0x735A2D97) & _WORD
    return word ^ (word >> 15)


@njit
def _uniform(key_a: int, key_b: int, counter: int) -> float:
    """A number in (0, 1) for the counter-th draw under a key of two words."""
    word = _mixed((_mixed((counter * 0x9E3779B9 + key_a) & _WORD) + key_b) & _WORD)
    return (word + 0.5) / 4294967296.0


@njit
def add_noise(ranges: NDArray[np.float32], cells: Cells, noise: Noise) -> None:
    """Disturb the scans of the cells, which are the rows ``cells.nodes`` of ``ranges``."""
    top = np.float32(noise.max_range_m)
    for i in range(len(cells.rows)):
        row, column = int(cells.rows[i]), int(cells.columns[i])
        key_a = _mixed(_mixed(_mixed(noise.seed_low) ^ row) ^ column)
        key_b = _mixed(_mixed(_mixed(noise.seed_high ^ 0x5BD1E995) + column & _WORD) + row & _WORD)
        scan = ranges[cells.nodes[i]]
        for beam in range(len(scan)):
            kind = _uniform(key_a, key_b, 4 * beam)
            if kind < noise.p_max:
                scan[beam] = top
            elif kind < noise.p_max + noise.p_random:
                drawn = np.float32(_uniform(key_a, key_b, 4 * beam + 1) * noise.max_range_m)
                scan[beam] = min(drawn, top)
            elif noise.sigma_m > 0.0 and scan[beam] < top:
                # Box and Muller's transform of two uniform numbers to a gaussian one.
                radius = np.sqrt(-2.0 * np.log(_uniform(key_a, key_b, 4 * beam + 2)))
                turn = 2.0 * np.pi * _uniform(key_a, key_b, 4 * beam + 3)
                noisy = np.float32(scan[beam] + noise.sigma_m * radius * np.cos(turn))
                scan[beam] = min(max(noisy, np.float32(0.0)), top)
