"""What the instructions of :mod:`~pgm_places.kernels.parts` become in compiled kernels."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.registry import cpu_target
from numba.core.typing.templates import signature
from numba.extending import models, register_model

from pgm_places.kernels.deferred import ByRegisters
from pgm_places.kernels.lane_type import Emit, LanesType, Rule
from pgm_places.kernels.lanes import LANES
from pgm_places.kernels.parts import PART

__all__ = ["PART_RULES", "PartType", "chosen", "row_pointer", "row_type"]


class PartType(types.Type):  # type: ignore[misc]
    """Rows of lanes in memory, each ``stride`` numbers after the one before."""

    def __init__(self, dtype: types.Type, count: int, stride: int) -> None:
        self.dtype, self.count, self.stride = dtype, count, stride
        super().__init__(name=f"Part({dtype} x {count} of {stride})")


@register_model(PartType)
class _PartModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, part_type: PartType) -> None:
        number = manager.lookup(part_type.dtype).get_data_type()
        super().__init__(manager, part_type, number.as_pointer())


def has_many_registers() -> bool:
    """Whether code is made for a processor with 32 registers of sixteen floats."""
    features: str = cpu_target.target_context.codegen().magic_tuple()[2]
    return "+avx512f" in features.split(",")


def chosen(value: Any) -> Any:
    """What kernels find under a name: the one of two that suits the processor, or the value."""
    if isinstance(value, ByRegisters):
        return value.many if has_many_registers() else value.few
    return value


def row_type(planes: Any) -> LanesType:
    """The vector that a row of planes is, or a row of a part of them."""
    return LanesType(planes.dtype, planes.count if isinstance(planes, PartType) else LANES)


def row_pointer(context: Any, builder: Any, planes: Any, value: Any, row: Any) -> Any:
    """The address of a row of planes, or of a part of them, as that of a vector."""
    if isinstance(planes, PartType):
        data, stride = value, planes.stride
    else:
        data, stride = context.make_array(planes)(context, builder, value).data, LANES
    first = builder.gep(data, [builder.mul(row, ir.Constant(row.type, stride))])
    return builder.bitcast(first, context.get_value_type(row_type(planes)).as_pointer())


def _part_rule(planes: Any, lane: Any) -> tuple[Any, Emit]:  # noqa: ARG001
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        return builder.gep(data, [args[1]])

    return signature(PartType(planes.dtype, chosen(PART), LANES), planes, types.intp), emit


def _room_rule(planes: Any) -> tuple[Any, Emit]:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.make_array(sig.args[0])(context, builder, args[0]).data

    return signature(PartType(planes.dtype, chosen(PART), chosen(PART)), planes), emit


PART_RULES: dict[str, Rule] = {"part": _part_rule, "room": _room_rule}
"""The rule of each instruction by its name."""
