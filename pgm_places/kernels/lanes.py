"""Vectors of sixteen numbers for kernels: one lane for each of sixteen independent problems.

A kernel that works on sixteen scans at a time writes ``load(plane, row)`` for row ``row`` of an
array of shape (rows, 16) and combines such vectors with ``+ - * /``, comparisons and the functions
below. They become vector instructions of whatever width the processor has. No operation mixes
lanes, and sums and fused products are exactly those written, so that a lane's bits depend neither
on the other lanes nor on the machine. Under ``NUMBA_DISABLE_JIT=1`` the same names work on NumPy
rows.

The arrays must be C-contiguous, of float32 or float64; ``aligned_planes`` makes them so that no
vector straddles two cache lines.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.deferred import instruction

__all__ = [
    "LANES",
    "absolute",
    "add_to",
    "aligned_planes",
    "any_lane",
    "fma",
    "largest",
    "load",
    "narrow",
    "nearest_integer",
    "power_of_two",
    "select",
    "smallest",
    "splat",
    "square_root",
    "store",
    "transpose_block",
    "widen",
]

LANES = 16

CACHE_LINE_BYTES = 64


def aligned_planes(rows: int, dtype: Any) -> NDArray[Any]:
    """(rows, 16) uninitialised array that starts on a cache line."""
    size = rows * LANES * np.dtype(dtype).itemsize
    raw = np.empty(size + CACHE_LINE_BYTES, np.uint8)
    start = -raw.ctypes.data % CACHE_LINE_BYTES
    return raw[start : start + size].view(dtype).reshape(rows, LANES)


@instruction
def load(planes: NDArray[Any], row: int) -> Any:
    """Row ``row`` as a vector."""
    return planes[row].copy()


@instruction
def store(planes: NDArray[Any], row: int, value: Any) -> None:
    """Write a vector of the array's own type to row ``row``."""
    planes[row] = value


@instruction
def add_to(planes: NDArray[Any], row: int, value: Any) -> None:
    """Add a vector of the array's own type to row ``row``."""
    planes[row] += value


@instruction
def splat(value: Any) -> Any:
    """The number in every lane; float64 for a plain float."""
    return np.full(LANES, value)


@instruction
def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` rounded once."""
    return a * b + c


@instruction
def square_root(a: Any) -> Any:
    """The square root of every lane."""
    return np.sqrt(a)


@instruction
def absolute(a: Any) -> Any:
    """The absolute value of every lane."""
    return np.abs(a)


@instruction
def nearest_integer(a: Any) -> Any:
    """Every lane rounded to the nearest integer, halves to the even one."""
    return np.rint(a)


@instruction
def power_of_two(a: Any) -> Any:
    """2 to the power of every lane: float64, whole numbers from -1022 to 1023."""
    return np.ldexp(1.0, a.astype(np.int64))


@instruction
def smallest(a: Any, b: Any) -> Any:
    """The smaller of two numbers without NaN, lane by lane."""
    return np.minimum(a, b)


@instruction
def largest(a: Any, b: Any) -> Any:
    """The larger of two numbers without NaN, lane by lane."""
    return np.maximum(a, b)


@instruction
def select(mask: Any, a: Any, b: Any) -> Any:
    """``a`` where ``mask`` holds, ``b`` elsewhere."""
    return np.where(mask, a, b)


@instruction
def any_lane(mask: Any) -> bool:
    """Whether the mask holds in any lane."""
    return bool(mask.any())


@instruction
def narrow(a: Any) -> Any:
    """The lanes rounded to float32."""
    return a.astype(np.float32)


@instruction
def widen(a: Any) -> Any:
    """The lanes as float64."""
    return a.astype(np.float64)


@instruction
def transpose_block(
    source: NDArray[Any],
    source_rows: NDArray[np.intp],
    source_column: int,
    target: NDArray[Any],
    target_rows: NDArray[np.intp],
    target_column: int,
) -> None:
    """Write the transpose of sixteen pieces of rows to sixteen pieces of rows, each 16 long.

    Both matrices are C-contiguous and of the same type; ``*_rows`` hold sixteen row numbers.
    """
    block = source[source_rows[:LANES], source_column : source_column + LANES]
    target[target_rows[:LANES], target_column : target_column + LANES] = block.T
