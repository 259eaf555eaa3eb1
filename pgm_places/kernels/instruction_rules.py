"""What instructions become in compiled kernels, by name.

A rule takes the argument types, and gives the signature of the call and the generator of its code.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from pgm_places.kernels.lane_access_rules import ACCESS_RULES
from pgm_places.kernels.lane_type import Emit, LanesType, Rule, as_lanes, llvm_call, splat_value
from pgm_places.kernels.lanes import LANES
from pgm_places.kernels.part_rules import PART_RULES, row_pointer, row_type
from pgm_places.kernels.register_rules import REGISTER_RULES

__all__ = ["intrinsic_named"]


def intrinsic_named(name: str, n_arguments: int) -> Any:
    """The instruction of that name, for numba."""
    rule = _RULES[name]
    # numba wants a function with exactly the arguments of the call
    if n_arguments == 1:
        return intrinsic(lambda context, a: rule(a))
    if n_arguments == 2:
        return intrinsic(lambda context, a, b: rule(a, b))
    if n_arguments == 3:
        return intrinsic(lambda context, a, b, c: rule(a, b, c))
    if n_arguments == 4:
        return intrinsic(lambda context, a, b, c, d: rule(a, b, c, d))
    return intrinsic(lambda context, a, b, c, d, e, f: rule(a, b, c, d, e, f))


def _load_rule(planes: Any, row: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.load(row_pointer(context, builder, sig.args[0], *args))
        value.align = sig.args[0].dtype.bitwidth // 8
        return value

    return signature(row_type(planes), planes, types.intp), emit


def _store_rule(planes: Any, row: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = row_pointer(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], pointer).align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return signature(types.void, planes, types.intp, value), emit


def _add_rule(planes: Any, row: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = row_pointer(context, builder, sig.args[0], args[0], args[1])
        before = builder.load(pointer)
        before.align = sig.args[0].dtype.bitwidth // 8
        builder.store(builder.fadd(before, args[2]), pointer).align = before.align
        return context.get_dummy_value()

    return signature(types.void, planes, types.intp, value), emit


def _splat_rule(value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return splat_value(builder, context.get_value_type(sig.return_type), args[0])

    return signature(LanesType(value), value), emit


def _same(name: str) -> Rule:
    def rule(*operands: Any) -> tuple[Any, Emit]:
        return signature(_lanes_among(operands), *operands), llvm_call(name)

    return rule


def _lanes_among(operands: Any) -> Any:
    """The type of the vectors among vectors and numbers."""
    return next(kind for kind in operands if isinstance(kind, LanesType))


def _pick_rule(comparison: str) -> Rule:
    """``a if a <comparison> b else b``: one instruction, where LLVM's minnum would guard NaN."""

    def rule(a: Any, b: Any) -> tuple[Any, Emit]:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            operands = as_lanes(context, builder, sig, args)
            return builder.select(builder.fcmp_ordered(comparison, *operands), *operands)

        return signature(_lanes_among((a, b)), a, b), emit

    return rule


def _select_rule(mask: Any, a: Any, b: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*as_lanes(context, builder, sig, args))

    return signature(_lanes_among((a, b)), mask, a, b), emit


def _power_rule(a: Any) -> tuple[Any, Emit]:
    """The bits of a double's exponent, which adding a large number leaves in the lowest places."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vector = args[0].type
        words = ir.VectorType(ir.IntType(64), vector.count)
        large = splat_value(builder, vector, ir.Constant(vector.element, 1.5 * 2.0**52 + 1023))
        places = splat_value(builder, words, ir.Constant(words.element, 52))
        bits = builder.bitcast(builder.fadd(args[0], large), words)
        return builder.bitcast(builder.shl(bits, places), vector)

    return signature(a, a), emit


def _alike_rule(like: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return as_lanes(context, builder, sig, args)[1]

    return signature(like, like, value), emit


def _any_rule(mask: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], ir.IntType(args[0].type.count))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return signature(types.boolean, mask), emit


def _cast_rule(scalar: Any, instruction: str) -> Rule:
    def rule(a: Any) -> tuple[Any, Emit]:
        def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            wanted = context.get_value_type(sig.return_type)
            if args[0].type == wanted:
                return args[0]
            return getattr(builder, instruction)(args[0], wanted)

        return signature(LanesType(scalar, a.count), a), emit

    return rule


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


def _prefetch_rule(array: Any, index: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = context.make_array(sig.args[0])(context, builder, args[0])
        byte = ir.IntType(8).as_pointer()
        address = builder.bitcast(builder.gep(values.data, [args[1]]), byte)
        word = ir.IntType(32)
        hint = builder.module.declare_intrinsic(
            "llvm.prefetch", [byte], ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        )
        for_writing, keep_in_all_caches, data = word(1), word(3), word(1)
        builder.call(hint, [address, for_writing, keep_in_all_caches, data])
        return context.get_dummy_value()

    return signature(types.void, array, index), emit


_RULES: dict[str, Rule] = {
    **ACCESS_RULES,
    **PART_RULES,
    **REGISTER_RULES,
    "absolute": _same("fabs"),
    "add_to": _add_rule,
    "alike": _alike_rule,
    "any_lane": _any_rule,
    "fma": _same("fma"),
    "largest": _pick_rule(">"),
    "load": _load_rule,
    "narrow": _cast_rule(types.float32, "fptrunc"),
    "nearest_integer": _same("rint"),
    "power_of_two": _power_rule,
    "prefetch": _prefetch_rule,
    "select": _select_rule,
    "smallest": _pick_rule("<"),
    "splat": _splat_rule,
    "square_root": _same("sqrt"),
    "store": _store_rule,
    "transpose_block": _block_rule,
    "widen": _cast_rule(types.float64, "fpext"),
}
