"""The vector type of :mod:`~pgm_places.kernels.lanes` for numba: type, operators, intrinsics."""
# numba calls generators and templates with a fixed list of arguments:
# ruff: noqa: ARG002

import operator
from collections.abc import Callable
from typing import Any, ClassVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

from pgm_places.kernels.lanes import LANES

__all__ = ["Emit", "LanesType", "Rule", "as_lanes", "llvm_call", "splat_value"]


class LanesType(types.Type):  # type: ignore[misc]
    """Sixteen floats, or another count, or as many truth values where ``scalar`` is boolean."""

    def __init__(self, scalar: types.Type, count: int = LANES) -> None:
        self.scalar, self.count = scalar, count
        super().__init__(name=f"Lanes({scalar} x {count})")


_ELEMENTS = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.boolean: ir.IntType(1),
}


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, lanes_type: LanesType) -> None:
        vector = ir.VectorType(_ELEMENTS[lanes_type.scalar], lanes_type.count)
        super().__init__(manager, lanes_type, vector)


Emit = Callable[[Any, Any, Any, Any], Any]
Rule = Callable[..., tuple[Any, Emit]]


def splat_value(builder: Any, vector: Any, value: Any) -> Any:
    """A vector whose lanes all hold the value."""
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return builder.shuffle_vector(first, undefined, zeros)


def as_lanes(context: Any, builder: Any, sig: Any, args: Any) -> list[Any]:
    """The operands of a call as vectors: a number is put in every lane."""
    lanes_type = [kind for kind in sig.args if isinstance(kind, LanesType)][-1]
    vector = context.get_value_type(lanes_type)
    return [
        value
        if isinstance(kind, LanesType)
        else splat_value(builder, vector, context.cast(builder, value, kind, lanes_type.scalar))
        for kind, value in zip(sig.args, args, strict=True)
    ]


def llvm_call(name: str) -> Emit:
    """The generator of a call of LLVM's element-wise function of that name."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        operands = as_lanes(context, builder, sig, args)
        vector = operands[0].type
        suffix = "f32" if isinstance(vector.element, ir.FloatType) else "f64"
        kind = ir.FunctionType(vector, [vector] * len(args))
        full_name = f"llvm.{name}.v{vector.count}{suffix}"
        call = cgutils.get_or_insert_function(builder.module, kind, full_name)
        return builder.call(call, operands)

    return emit


def _register_operator(function: Any, emit_lanes: Callable[..., Any], gives_mask: bool) -> None:
    """Let ``function`` take two vectors, or a vector and a number, which is put in every lane."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        key = function
        metadata: ClassVar[dict[str, str]] = {"target": "cpu"}  # asked before numba's generic ones

        def generic(self, args: Any, kws: Any) -> Any:
            lanes = [a for a in args if isinstance(a, LanesType)]
            if len(args) != 2 or not lanes:
                return None
            numbers = [a for a in args if not isinstance(a, LanesType)]
            if any(a != lanes[0] for a in lanes) or any(
                not isinstance(a, types.Float | types.Integer) for a in numbers
            ):
                return None
            mask = LanesType(types.boolean, lanes[0].count)
            return signature(mask if gives_mask else lanes[0], *args)

    infer_global(function)(Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit_lanes(builder, *as_lanes(context, builder, sig, args))

    for pair in (
        (LanesType, LanesType),
        (LanesType, types.Number),
        (types.Number, LanesType),
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


_register_operators()
