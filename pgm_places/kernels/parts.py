"""Parts of sixteen lanes: as many as a kernel's numbers fit into the processor's registers with.

With AVX-512 a register holds sixteen floats, and there are 32 of them. Other processors have room
for a quarter of that: eight floats in each of sixteen registers, or four in each of 32. There a
kernel with many numbers at work handles the lanes of its planes in two parts, one after the other,
or most of its time goes into moving numbers to memory and back. Lanes never mix, so results have
the same bits either way; the planes are the same as well, so that code for one processor also runs
on another one.

A part stands for planes in every function of :mod:`~pgm_places.kernels.lanes` that takes a row.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.deferred import by_registers, instruction
from pgm_places.kernels.lanes import LANES

__all__ = ["PART", "alike", "part", "room"]

PART: int = by_registers(many=LANES, few=LANES // 2)
"""Lanes of a part; all of them where kernels run uncompiled."""


@instruction
def part(planes: NDArray[Any], lane: int) -> Any:
    """The lanes ``lane..lane + PART - 1`` of all rows."""
    return planes[:, lane : lane + PART]


@instruction
def room(planes: NDArray[Any]) -> Any:
    """The memory of planes as rows of ``PART`` lanes: half as much of it is in use."""
    return planes.reshape(-1, PART)


@instruction
def alike(lanes: Any, value: float) -> Any:
    """The number in every lane of a vector like another one."""
    return np.full_like(lanes, value)
