"""Sensor noise as a function of seed, cell and beam: no generator's state, so no order either."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.jit import njit

__all__ = ["add_noise"]

_WORD = 0xFFFFFFFF  # arithmetic is on 32-bit words held in larger integers


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
def add_noise(
    ranges: NDArray[np.float32],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    nodes: NDArray[np.int32],
    seed_low: int,
    seed_high: int,
    sigma_m: float,
    p_random: float,
    p_max: float,
    max_range_m: float,
) -> None:
    """Disturb the scans of the cells (rows, columns), which are the rows ``nodes`` of ranges."""
    top = np.float32(max_range_m)
    for i in range(len(rows)):
        row, column = int(rows[i]), int(columns[i])
        key_a = _mixed(_mixed(_mixed(seed_low) ^ row) ^ column)
        key_b = _mixed(_mixed(_mixed(seed_high ^ 0x5BD1E995) + column & _WORD) + row & _WORD)
        scan = ranges[nodes[i]]
        for beam in range(len(scan)):
            kind = _uniform(key_a, key_b, 4 * beam)
            if kind < p_max:
                scan[beam] = top
            elif kind < p_max + p_random:
                drawn = np.float32(_uniform(key_a, key_b, 4 * beam + 1) * max_range_m)
                scan[beam] = min(drawn, top)
            elif sigma_m > 0.0 and scan[beam] < top:
                # Box and Muller's transform of two uniform numbers to a gaussian one.
                radius = np.sqrt(-2.0 * np.log(_uniform(key_a, key_b, 4 * beam + 2)))
                turn = 2.0 * np.pi * _uniform(key_a, key_b, 4 * beam + 3)
                noisy = np.float32(scan[beam] + sigma_m * radius * np.cos(turn))
                scan[beam] = min(max(noisy, np.float32(0.0)), top)
