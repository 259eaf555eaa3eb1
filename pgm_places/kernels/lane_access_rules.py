"""What the instructions of :mod:`~pgm_places.kernels.lane_access` become in compiled kernels."""

import functools
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature

from pgm_places.kernels.lane_access import EIGHT, FOUR
from pgm_places.kernels.lane_type import Emit, LanesType, Rule, splat_value
from pgm_places.kernels.lanes import LANES

__all__ = ["ACCESS_RULES"]


def _require_rows(matrix: Any) -> None:
    if matrix.layout != "C":
        raise TypingError(f"a matrix of vectors must be C-contiguous, got layout {matrix.layout}")


def _pointer(context: Any, builder: Any, kind: Any, arguments: Any, vector: Any) -> Any:
    """The address of ``matrix[row, column]``, as that of a vector."""
    matrix, row, column = arguments
    array = context.make_array(kind)(context, builder, matrix)
    offset = builder.add(builder.mul(row, builder.extract_value(array.shape, 1)), column)
    return builder.bitcast(builder.gep(array.data, [offset]), vector.as_pointer())


def _load_rule(count: int) -> Rule:
    def rule(matrix: Any, row: Any, column: Any) -> tuple[Any, Emit]:
        _require_rows(matrix)

        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            vector = context.get_value_type(sig.return_type)
            value = builder.load(_pointer(context, builder, sig.args[0], args, vector))
            value.align = sig.args[0].dtype.bitwidth // 8
            return value

        lanes = LanesType(matrix.dtype, count)
        return signature(lanes, matrix, types.intp, types.intp), emit

    return rule


def _store_rule(matrix: Any, row: Any, column: Any, value: Any) -> tuple[Any, Emit]:
    _require_rows(matrix)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        place = _pointer(context, builder, sig.args[0], args[:3], args[3].type)
        builder.store(args[3], place).align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value), emit


def _bytes_rule(matrix: Any, row: Any, column: Any, value: Any) -> tuple[Any, Emit]:
    _require_rows(matrix)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        count = args[3].type.count
        words = builder.fptosi(args[3], ir.VectorType(ir.IntType(32), count))
        few = builder.trunc(words, ir.VectorType(ir.IntType(8), count))
        place = _pointer(context, builder, sig.args[0], args[:3], few.type)
        builder.store(few, place).align = 1
        return context.get_dummy_value()

    return signature(types.void, matrix, types.intp, types.intp, value), emit


def _spread_rule(few: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        indices = ir.VectorType(ir.IntType(32), few.count)
        lanes = [
            builder.shuffle_vector(args[0], args[0], ir.Constant(indices, [k] * few.count))
            for k in range(few.count)
        ]
        return context.make_tuple(builder, sig.return_type, lanes)

    return signature(types.UniTuple(few, few.count), few), emit


def _sum_rule(four: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        numbers = [builder.extract_element(args[0], ir.IntType(32)(k)) for k in range(FOUR)]
        return functools.reduce(builder.fadd, numbers)

    return signature(four.scalar, four), emit


def _halving_rule(combine: Callable[[Any, Any, Any], Any]) -> Rule:
    """One number from all lanes: halves are combined lane by lane until one is left."""

    def rule(lanes: Any) -> tuple[Any, Emit]:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            rest = args[0]
            while rest.type.count > 1:
                half = rest.type.count // 2
                indices = ir.VectorType(ir.IntType(32), half)
                halves = [
                    builder.shuffle_vector(
                        rest, rest, ir.Constant(indices, list(range(begin, begin + half)))
                    )
                    for begin in (0, half)
                ]
                rest = combine(builder, *halves)
            return builder.extract_element(rest, ir.IntType(32)(0))

        return signature(lanes.scalar, lanes), emit

    return rule


def _larger(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _field_rule(codes: Any, index: Any, shift: Any, mask: Any) -> tuple[Any, Emit]:
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


ACCESS_RULES: dict[str, Rule] = {
    "field_at": _field_rule,
    "highest_lane": _halving_rule(_larger),
    "load_at": _load_rule(LANES),
    "load_eight": _load_rule(EIGHT),
    "load_four": _load_rule(FOUR),
    "spread": _spread_rule,
    "store_at": _store_rule,
    "store_bytes": _bytes_rule,
    "store_eight": _store_rule,
    "store_four": _store_rule,
    "sum_of_four": _sum_rule,
    "sum_of_lanes": _halving_rule(lambda builder, a, b: builder.fadd(a, b)),
}
