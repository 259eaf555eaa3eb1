"""What the instructions of :mod:`~pgm_places.kernels.registers` become in compiled kernels."""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import signature

from pgm_places.kernels.lane_type import Emit, Rule

__all__ = ["REGISTER_RULES"]


def _replaced_rule(values: Any, index: Any, value: Any) -> tuple[Any, Emit]:  # noqa: ARG001
    def in_tuple(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        room = cgutils.alloca_once(builder, args[0].type)  # the compiler makes it registers again
        builder.store(args[0], room)
        builder.store(args[2], builder.gep(room, [args[1].type(0), args[1]], inbounds=True))
        return builder.load(room)

    def in_array(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array = context.make_array(sig.args[0])(context, builder, args[0])
        builder.store(args[2], builder.gep(array.data, [args[1]]))
        return impl_ret_borrowed(context, builder, sig.return_type, args[0])

    emit = in_tuple if isinstance(values, types.BaseTuple) else in_array
    return signature(values, values, types.intp, values.dtype), emit


def _blank_rule(values: Any) -> tuple[Any, Emit]:
    def itself(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        return args[0]

    def copied(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.compile_internal(builder, lambda array: array.copy(), sig, args)

    return signature(values, values), itself if isinstance(values, types.BaseTuple) else copied


REGISTER_RULES: dict[str, Rule] = {"blank": _blank_rule, "replaced": _replaced_rule}
"""The rule of each instruction by its name."""
