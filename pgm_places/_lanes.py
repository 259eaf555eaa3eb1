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

import operator
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model
from numpy.typing import NDArray

__all__ = [
    "LANES",
    "absolute",
    "aligned_planes",
    "any_lane",
    "fma",
    "largest",
    "load",
    "narrow",
    "select",
    "smallest",
    "splat",
    "square_root",
    "store",
    "widen",
]

F = TypeVar("F", bound=Callable[..., Any])

LANES = 16
CACHE_LINE_BYTES = 64


def aligned_planes(rows: int, dtype: Any) -> NDArray[Any]:
    """(rows, 16) uninitialised array that starts on a cache line."""
    size = rows * LANES * np.dtype(dtype).itemsize
    raw = np.empty(size + CACHE_LINE_BYTES, np.uint8)
    start = -raw.ctypes.data % CACHE_LINE_BYTES
    return raw[start : start + size].view(dtype).reshape(rows, LANES)


class _LanesType(types.Type):  # type: ignore[misc]
    """Sixteen floats, or sixteen truth values where ``scalar`` is boolean."""

    def __init__(self, scalar: types.Type) -> None:
        self.scalar = scalar
        super().__init__(name=f"Lanes({scalar})")


_ELEMENTS = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.boolean: ir.IntType(1),
}


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, lanes_type: _LanesType) -> None:
        vector = ir.VectorType(_ELEMENTS[lanes_type.scalar], LANES)
        super().__init__(manager, lanes_type, vector)


_MASK = _LanesType(types.boolean)

Emit = Callable[[Any, Any, Any, Any], Any]


def _compiled(rule: Callable[..., tuple[Any, Emit]]) -> Callable[[F], F]:
    """Replace a NumPy function by the vector instruction that ``rule`` emits in kernels.

    ``rule`` takes the argument types and gives the signature and the code generator.
    """

    def decorate(plain: F) -> F:
        if config.DISABLE_JIT:
            return plain

        # intrinsic wants a function with exactly the arguments of the call
        count = plain.__code__.co_argcount
        if count == 1:
            made = intrinsic(lambda context, a: rule(a))
        elif count == 2:
            made = intrinsic(lambda context, a, b: rule(a, b))
        else:
            made = intrinsic(lambda context, a, b, c: rule(a, b, c))
        return made  # type: ignore[no-any-return]

    return decorate


def _splat(builder: Any, vector: Any, value: Any) -> Any:
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, undefined, zeros)


def _llvm(name: str) -> Emit:
    """The generator of a call of LLVM's element-wise function of that name."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        vector = args[0].type
        suffix = "f32" if isinstance(vector.element, ir.FloatType) else "f64"
        kind = ir.FunctionType(vector, [vector] * len(args))
        call = cgutils.get_or_insert_function(
            builder.module, kind, f"llvm.{name}.v{LANES}{suffix}"
        )
        return builder.call(call, args)

    return emit


def _row_pointer(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    first = builder.gep(data, [builder.mul(row, ir.Constant(row.type, LANES))])
    vector = context.get_value_type(_LanesType(array_type.dtype))
    return builder.bitcast(first, vector.as_pointer())


def _load_rule(planes: Any, row: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = builder.load(_row_pointer(context, builder, sig.args[0], *args))
        value.align = sig.args[0].dtype.bitwidth // 8
        return value

    return signature(_LanesType(planes.dtype), planes, types.intp), emit


@_compiled(_load_rule)
def load(planes: NDArray[Any], row: int) -> Any:
    """Row ``row`` as a vector."""
    return planes[row].copy()


def _store_rule(planes: Any, row: Any, value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _row_pointer(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], pointer).align = sig.args[0].dtype.bitwidth // 8
        return context.get_dummy_value()

    return signature(types.void, planes, types.intp, value), emit


@_compiled(_store_rule)
def store(planes: NDArray[Any], row: int, value: Any) -> None:
    """Write a vector of the array's own type to row ``row``."""
    planes[row] = value


def _splat_rule(value: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _splat(builder, context.get_value_type(sig.return_type), args[0])

    return signature(_LanesType(value), value), emit


@_compiled(_splat_rule)
def splat(value: Any) -> Any:
    """The number in every lane; float64 for a plain float."""
    return np.full(LANES, value)


def _same(count: int, name: str) -> Callable[..., tuple[Any, Emit]]:
    def rule(*operands: Any) -> tuple[Any, Emit]:
        return signature(operands[0], *[operands[0]] * count), _llvm(name)

    return rule


@_compiled(_same(3, "fma"))
def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c`` rounded once."""
    return a * b + c


@_compiled(_same(1, "sqrt"))
def square_root(a: Any) -> Any:
    """The square root of every lane."""
    return np.sqrt(a)


@_compiled(_same(1, "fabs"))
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


@_compiled(_pick_rule("<"))
def smallest(a: Any, b: Any) -> Any:
    """The smaller of two numbers without NaN, lane by lane."""
    return np.minimum(a, b)


@_compiled(_pick_rule(">"))
def largest(a: Any, b: Any) -> Any:
    """The larger of two numbers without NaN, lane by lane."""
    return np.maximum(a, b)


def _select_rule(mask: Any, a: Any, b: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*args)

    return signature(a, mask, a, a), emit


@_compiled(_select_rule)
def select(mask: Any, a: Any, b: Any) -> Any:
    """``a`` where ``mask`` holds, ``b`` elsewhere."""
    return np.where(mask, a, b)


def _any_rule(mask: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return signature(types.boolean, mask), emit


@_compiled(_any_rule)
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

        return signature(_LanesType(scalar), a), emit

    return rule


@_compiled(_cast_rule(types.float32, "fptrunc"))
def narrow(a: Any) -> Any:
    """The lanes rounded to float32."""
    return a.astype(np.float32)


@_compiled(_cast_rule(types.float64, "fpext"))
def widen(a: Any) -> Any:
    """The lanes as float64."""
    return a.astype(np.float64)


def _register_operator(function: Any, emit_lanes: Callable[..., Any], gives_mask: bool) -> None:
    """Let ``function`` take two vectors, or a vector and a number, which is put in every lane."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            lanes = [a for a in args if isinstance(a, _LanesType)]
            if len(args) != 2 or not lanes:
                return None
            numbers = [a for a in args if not isinstance(a, _LanesType)]
            if any(a != lanes[0] for a in lanes) or any(
                not isinstance(a, types.Float | types.Integer) for a in numbers
            ):
                return None
            return signature(_MASK if gives_mask else lanes[0], *args)

    infer_global(function)(Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        lanes_type = next(a for a in sig.args if isinstance(a, _LanesType))
        vector = context.get_value_type(lanes_type)
        spread = [
            value
            if isinstance(kind, _LanesType)
            else _splat(builder, vector, context.cast(builder, value, kind, lanes_type.scalar))
            for kind, value in zip(sig.args, args, strict=True)
        ]
        return emit_lanes(builder, *spread)

    for pair in (
        (_LanesType, _LanesType),
        (_LanesType, types.Number),
        (types.Number, _LanesType),
    ):
        lower_builtin(function, *pair)(lower)


def _register_operators() -> None:
    arithmetic = {
        operator.add: "fadd",
        operator.sub: "fsub",
        operator.mul: "fmul",
        operator.truediv: "fdiv",
    }
    for function, name in arithmetic.items():
        _register_operator(
            function, lambda builder, a, b, name=name: getattr(builder, name)(a, b), False
        )
    for function, sign in {
        operator.lt: "<",
        operator.le: "<=",
        operator.gt: ">",
        operator.ge: ">=",
        operator.eq: "==",
        operator.ne: "!=",
    }.items():
        _register_operator(
            function,
            lambda builder, a, b, sign=sign: (
                builder.fcmp_unordered(sign, a, b)
                if sign == "!="
                else builder.fcmp_ordered(sign, a, b)
            ),
            True,
        )
    for function, name in {operator.and_: "and_", operator.or_: "or_"}.items():
        _register_operator(
            function, lambda builder, a, b, name=name: getattr(builder, name)(a, b), True
        )


if not config.DISABLE_JIT:
    _register_operators()
