"""Kernels that handle lanes in parts give the same bits whatever the processor's registers."""

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.deferred import by_registers
from pgm_places.kernels.jit import njit
from pgm_places.kernels.lanes import LANES, aligned_planes, fma, largest, load, select, store
from pgm_places.kernels.parts import PART, alike, part, room

Planes = NDArray[np.float64]

MANY: bool = by_registers(many=True, few=False)


@njit
def _is_for_many() -> bool:
    return MANY


@njit
def _halved(planes: Planes, spare: Planes, out: Planes) -> int:
    """Numbers and vectors in one call; returns the number of parts."""
    n_parts = 0
    for lane in range(0, LANES, PART):
        x = load(part(planes, lane), 1)
        number = alike(x, -1.0)
        store(room(spare), 2, fma(x, 0.5, select(x < 0.0, number, 0.0)))
        store(part(out, lane), 0, largest(load(room(spare), 2), 0.25))
        n_parts += 1
    return n_parts


def test_parts_are_computed_like_all_lanes() -> None:
    planes, spare, out = (aligned_planes(3, np.float64) for _ in range(3))
    planes[:] = np.random.default_rng(0).normal(size=planes.shape)
    n_parts = _halved(planes, spare, out)
    assert n_parts == (1 if _is_for_many() else 2)
    x = planes[1]
    np.testing.assert_array_equal(out[0], np.maximum(x / 2 - (x < 0), 0.25))
