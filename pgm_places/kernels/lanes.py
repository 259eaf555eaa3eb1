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

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature
from numpy.typing import NDArray

from pgm_places.kernels.lane_type import LANES, Emit, LanesType, compiled, llvm_call, splat_value

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
    "select",
    "smallest",
    "splat",
    "square_root",
    "store",
    "transpose_block",
    "widen",
]

CACHE_LINE_BYTES = 64


def aligned_planes(rows: int, dtype: Any) -> NDArray[Any]:
    """(rows, 16) uninitialised array that starts on a cache line."""
    size = rows * LANES * np.dtype(dtype).itemsize
    raw = np.empty(size + CACHE_LINE_BYTES, np.uint8)
    start = -raw.ctypes.data % CACHE_LINE_BYTES
    return raw[start : start + size].view(dtype).reshape(rows, LANES)


def _row_pointer(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    first = builder.gep(data, [builder.mul(row, ir.Constant(row.type, LANES))])
    vector = context.get_value_type(LanesType(array_type.dtype))
    return builder.bitcast(first, vector.as_pointer())


def _load_rule(planes: Any, row: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.load(_row_pointer(context, builder, sig.args[0], *args))
        value.align = sig.args[0].dtype.bitwidth // 8
        return value

    return signature(LanesType(planes.dtype), planes, types.intp), emit


@compiled(_load_rule)
def load(planes: NDArray[Any], row: int) -> Any:
    """Row ``row`` as a vector."""
    return planes[row].copy()


def _store_rule(planes: Any, row: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _row_pointer(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], pointer).align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return signature(types.void, planes, types.intp, value), emit


@compiled(_store_rule)
def store(planes: NDArray[Any], row: int, value: Any) -> None:
    """Write a vector of the array's own type to row ``row``."""
    planes[row] = value


def _add_rule(planes: Any, row: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _row_pointer(context, builder, sig.args[0], args[0], args[1])
        before = builder.load(pointer)
        before.align = sig.args[0].dtype.bitwidth // 8
        builder.store(builder.fadd(before, args[2]), pointer).align = before.align
        return context.get_dummy_value()

    return signature(types.void, planes, types.intp, value), emit


@compiled(_add_rule)
def add_to(planes: NDArray[Any], row: int, value: Any) -> None:
    """Add a vector of the array's own type to row ``row``."""
    planes[row] += value


def _splat_rule(value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return splat_value(builder, context.get_value_type(sig.return_type), args[0])

    return signature(LanesType(value), value), emit


@compiled(_splat_rule)
def splat(value: Any) -> Any:
    """The number in every lane; float64 for a plain float."""
    return np.full(LANES, value)


def _same(count: int, name: str) -> Callable[..., tuple[Any, Emit]]:
    def rule(*operands: Any) -> tuple[Any, Emit]:
        return signature(operands[0], *[operands[0]] * count), llvm_call(name)

    return rule


@compiled(_same(3, "fma"))
def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` rounded once."""
    return a * b + c


@compiled(_same(1, "sqrt"))
def square_root(a: Any) -> Any:
    """The square root of every lane."""
    return np.sqrt(a)


@compiled(_same(1, "fabs"))
def absolute(a: Any) -> Any:
    """The absolute value of every lane."""
    return np.abs(a)


def _pick_rule(comparison: str) -> Callable[..., tuple[Any, Emit]]:
    """``a if a <comparison> b else b``: one instruction, where LLVM's minnum would guard NaN."""

    def rule(a: Any, b: Any) -> tuple[Any, Emit]:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered(comparison, *args), *args)

        return signature(a, a, a), emit

    return rule


@compiled(_same(1, "rint"))
def nearest_integer(a: Any) -> Any:
    """Every lane rounded to the nearest integer, halves to the even one."""
    return np.rint(a)


@compiled(_pick_rule("<"))
def smallest(a: Any, b: Any) -> Any:
    """The smaller of two numbers without NaN, lane by lane."""
    return np.minimum(a, b)


@compiled(_pick_rule(">"))
def largest(a: Any, b: Any) -> Any:
    """The larger of two numbers without NaN, lane by lane."""
    return np.maximum(a, b)


def _select_rule(mask: Any, a: Any, b: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*args)

    return signature(a, mask, a, a), emit


@compiled(_select_rule)
def select(mask: Any, a: Any, b: Any) -> Any:
    """``a`` where ``mask`` holds, ``b`` elsewhere."""
    return np.where(mask, a, b)


def _any_rule(mask: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return signature(types.boolean, mask), emit


@compiled(_any_rule)
def any_lane(mask: Any) -> bool:
    """Whether the mask holds in any lane."""
    return bool(mask.any())


def _cast_rule(scalar: Any, instruction: str) -> Callable[..., tuple[Any, Emit]]:
    def rule(a: Any) -> tuple[Any, Emit]:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            wanted = context.get_value_type(sig.return_type)
            if args[0].type == wanted:
                return args[0]
            return getattr(builder, instruction)(args[0], wanted)

        return signature(LanesType(scalar), a), emit

    return rule


@compiled(_cast_rule(types.float32, "fptrunc"))
def narrow(a: Any) -> Any:
    """The lanes rounded to float32."""
    return a.astype(np.float32)


@compiled(_cast_rule(types.float64, "fpext"))
def widen(a: Any) -> Any:
    """The lanes as float64."""
    return a.astype(np.float64)


def _block_rule(
    source: Any, source_rows: Any, source_column: Any, target: Any, target_rows: Any, column: Any
) -> tuple[Any, Emit]:
    return (
        signature(types.void, source, source_rows, types.intp, target, target_rows, types.intp),
        _emit_block_transpose,
    )


def _emit_block_transpose(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Load sixteen vectors, interleave them pairwise in four rounds, store sixteen vectors."""
    source, source_rows, source_column, target, target_rows, column = args
    source_at = _pointers(context, builder, sig.args[0:2], source, source_rows, source_column)
    rows = []
    for pointer in source_at:
        row = builder.load(pointer)
        row.align = sig.args[0].dtype.bitwidth // 8
        rows.append(row)
    picks = [
        ir.Constant(
            ir.VectorType(ir.IntType(32), LANES),
            [k // 2 + half + LANES * (k % 2) for k in range(LANES)],
        )
        for half in (0, LANES // 2)
    ]
    for _ in range(LANES.bit_length() - 1):
        rows = [
            builder.shuffle_vector(rows[k], rows[k + LANES // 2], pick)
            for k in range(LANES // 2)
            for pick in picks
        ]
    for pointer, row in zip(
        _pointers(context, builder, sig.args[3:5], target, target_rows, column), rows, strict=True
    ):
        builder.store(row, pointer).align = sig.args[3].dtype.bitwidth // 8
    return context.get_dummy_value()


def _pointers(
    context: Any, builder: Any, kinds: Any, matrix: Any, rows: Any, column: Any
) -> list[Any]:
    """Addresses of sixteen vectors that start at ``matrix[rows[k], column]``."""
    array = context.make_array(kinds[0])(context, builder, matrix)
    width = builder.extract_value(array.shape, 1)
    numbers = context.make_array(kinds[1])(context, builder, rows).data
    vector = context.get_value_type(LanesType(kinds[0].dtype)).as_pointer()
    found = []
    for k in range(LANES):
        row = builder.load(builder.gep(numbers, [ir.Constant(width.type, k)]))
        offset = builder.add(builder.mul(row, width), column)
        found.append(builder.bitcast(builder.gep(array.data, [offset]), vector))
    return found


@compiled(_block_rule)
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
