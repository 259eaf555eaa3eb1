"""Lanes from any place of a matrix: vectors of sixteen or four numbers, and fields of bits.

The functions of :mod:`~pgm_places.kernels.lanes` combine these vectors as they do whole rows of
planes. Matrices must be C-contiguous; a vector may begin in any column, and nothing checks that it
ends within the matrix.
"""

import functools
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numpy.typing import NDArray

from pgm_places.kernels.lane_type import LANES, Emit, LanesType, compiled, splat_value

__all__ = [
    "FOUR",
    "field_at",
    "load_at",
    "load_four",
    "spread",
    "store_at",
    "store_four",
    "sum_of_four",
]

FOUR = 4


def _require_rows(matrix: Any) -> None:
    if matrix.layout != "C":
        raise TypingError(f"a matrix of vectors must be C-contiguous, got layout {matrix.layout}")


def _pointer(context: Any, builder: Any, kind: Any, arguments: Any, vector: Any) -> Any:
    """The address of ``matrix[row, column]``, as that of a vector."""
    matrix, row, column = arguments
    array = context.make_array(kind)(context, builder, matrix)
    offset = builder.add(builder.mul(row, builder.extract_value(array.shape, 1)), column)
    return builder.bitcast(builder.gep(array.data, [offset]), vector.as_pointer())


def _load_rule(count: int) -> Callable[..., tuple[Any, Emit]]:
    def rule(matrix: Any, row: Any, column: Any) -> tuple[Any, Emit]:  # noqa: ARG001  only typed
        _require_rows(matrix)

        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            vector = context.get_value_type(sig.return_type)
            value = builder.load(_pointer(context, builder, sig.args[0], args, vector))
            value.align = sig.args[0].dtype.bitwidth // 8
            return value

        lanes = LanesType(matrix.dtype, count)
        return signature(lanes, matrix, types.intp, types.intp), emit

    return rule


def _store_rule(matrix: Any, row: Any, column: Any, value: Any) -> tuple[Any, Emit]:  # noqa: ARG001
    _require_rows(matrix)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _pointer(context, builder, sig.args[0], args[:3], args[3].type)
        builder.store(args[3], place).align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value), emit


@compiled(_load_rule(LANES))
def load_at(matrix: NDArray[Any], row: int, column: int) -> Any:
    """Sixteen numbers of a row, from ``column`` on."""
    return matrix[row, column : column + LANES].copy()


@compiled(_store_rule)
def store_at(matrix: NDArray[Any], row: int, column: int, value: Any) -> None:
    """Write a vector of the matrix's own type to a row, from ``column`` on."""
    matrix[row, column : column + LANES] = value


@compiled(_load_rule(FOUR))
def load_four(matrix: NDArray[Any], row: int, column: int) -> Any:
    """Four numbers of a row, from ``column`` on."""
    return matrix[row, column : column + FOUR].copy()


@compiled(_store_rule)
def store_four(matrix: NDArray[Any], row: int, column: int, value: Any) -> None:
    """Write four numbers to a row, from ``column`` on."""
    matrix[row, column : column + FOUR] = value


def _spread_rule(four: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        indices = ir.VectorType(ir.IntType(32), FOUR)
        lanes = [
            builder.shuffle_vector(args[0], args[0], ir.Constant(indices, [k] * FOUR))
            for k in range(FOUR)
        ]
        return context.make_tuple(builder, sig.return_type, lanes)

    return signature(types.UniTuple(four, FOUR), four), emit


@compiled(_spread_rule)
def spread(four: Any) -> Any:
    """Four vectors, each with one of the four numbers in all of its lanes."""
    return tuple(np.full(FOUR, number) for number in four)


def _sum_rule(four: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001  only typed
        numbers = [builder.extract_element(args[0], ir.IntType(32)(k)) for k in range(FOUR)]
        return functools.reduce(builder.fadd, numbers)

    return signature(four.scalar, four), emit


@compiled(_sum_rule)
def sum_of_four(four: Any) -> Any:
    """The sum of the four numbers from the first to the last."""
    return functools.reduce(operator.add, four)


def _field_rule(codes: Any, index: Any, shift: Any, mask: Any) -> tuple[Any, Emit]:  # noqa: ARG001
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        vector = ir.VectorType(ir.IntType(8), LANES)
        place = builder.bitcast(builder.gep(data, [args[1]]), vector.as_pointer())
        bits = builder.load(place)
        bits.align = 1
        single = [builder.trunc(number, ir.IntType(8)) for number in args[2:]]
        shifts, masks = (splat_value(builder, vector, number) for number in single)
        field = builder.and_(builder.lshr(bits, shifts), masks)
        return builder.uitofp(field, context.get_value_type(sig.return_type))

    lanes = LanesType(types.float32)
    return signature(lanes, codes, types.intp, types.intp, types.intp), emit


@compiled(_field_rule)
def field_at(codes: NDArray[np.uint8], index: int, shift: int, mask: int) -> Any:
    """``(code >> shift) & mask`` of sixteen bytes of an array, as float32."""
    field: NDArray[Any] = (codes[index : index + LANES] >> shift) & mask
    return field.astype(np.float32)
