"""A few numbers that a kernel keeps in registers: tuples to the compiler, changed one at a time.

A tuple's length is a constant to the compiler, which unrolls loops over it and keeps its entries
in registers, where an array would be written to memory and read again in every step of a chain.
For more numbers than registers the same source takes arrays, which are changed in place: a kernel
that needs the old values besides the new ones takes them from two different arrays.
"""

from typing import Any

from pgm_places.kernels.deferred import instruction

__all__ = ["blank", "replaced"]


@instruction
def replaced(values: Any, index: int, value: float) -> Any:
    """The numbers with another one at ``index``: a new tuple, or the array itself, changed."""
    if isinstance(values, tuple):
        return (*values[:index], value, *values[index + 1 :])
    values[index] = value
    return values


@instruction
def blank(values: Any) -> Any:
    """As many numbers of any value: the tuple itself, or another array."""
    return values if isinstance(values, tuple) else values.copy()
