"""Lanes from any place of a matrix: sixteen, eight or four numbers, and fields of bits.

The functions of :mod:`~pgm_places.kernels.lanes` combine these vectors as they do whole rows of
planes. Matrices must be C-contiguous; a vector may begin in any column, and nothing checks that it
ends within the matrix.
"""

import functools
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgm_places.kernels.deferred import instruction
from pgm_places.kernels.lanes import LANES

__all__ = [
    "EIGHT",
    "FOUR",
    "field_at",
    "highest_lane",
    "load_at",
    "load_eight",
    "load_four",
    "spread",
    "store_at",
    "store_bytes",
    "store_eight",
    "store_four",
    "sum_of_four",
    "sum_of_lanes",
]

FOUR, EIGHT = 4, 8


@instruction
def load_at(matrix: NDArray[Any], row: int, column: int) -> Any:
    """Sixteen numbers of a row, from ``column`` on."""
    return matrix[row, column : column + LANES].copy()


@instruction
def store_at(matrix: NDArray[Any], row: int, column: int, value: Any) -> None:
    """Write a vector of the matrix's own type to a row, from ``column`` on."""
    matrix[row, column : column + LANES] = value


@instruction
def load_four(matrix: NDArray[Any], row: int, column: int) -> Any:
    """Four numbers of a row, from ``column`` on."""
    return matrix[row, column : column + FOUR].copy()


@instruction
def store_four(matrix: NDArray[Any], row: int, column: int, value: Any) -> None:
    """Write four numbers to a row, from ``column`` on."""
    matrix[row, column : column + FOUR] = value


@instruction
def load_eight(matrix: NDArray[Any], row: int, column: int) -> Any:
    """Eight numbers of a row, from ``column`` on."""
    return matrix[row, column : column + EIGHT].copy()


@instruction
def store_eight(matrix: NDArray[Any], row: int, column: int, value: Any) -> None:
    """Write eight numbers to a row, from ``column`` on."""
    matrix[row, column : column + EIGHT] = value


@instruction
def store_bytes(matrix: NDArray[np.int8], row: int, column: int, value: Any) -> None:
    """Write eight whole numbers below 128 to a row of bytes, from ``column`` on."""
    matrix[row, column : column + EIGHT] = value


@instruction
def spread(few: Any) -> Any:
    """As many vectors as there are lanes, each with one of the numbers in all of its lanes."""
    return tuple(np.full(len(few), number) for number in few)


@instruction
def sum_of_four(four: Any) -> Any:
    """The sum of the four numbers from the first to the last."""
    return functools.reduce(operator.add, four)


@instruction
def sum_of_lanes(lanes: Any) -> Any:
    """The sum of all lanes: of the two halves' sums, added lane by lane until one is left."""
    while len(lanes) > 1:
        lanes = lanes[: len(lanes) // 2] + lanes[len(lanes) // 2 :]
    return lanes[0]


@instruction
def highest_lane(lanes: Any) -> Any:
    """The largest of all lanes; of none that is NaN."""
    return lanes.max()


@instruction
def field_at(codes: NDArray[np.uint8], index: int, shift: int, mask: int) -> Any:
    """``(code >> shift) & mask`` of sixteen bytes of an array, as float32."""
    field: NDArray[Any] = (codes[index : index + LANES] >> shift) & mask
    return field.astype(np.float32)
