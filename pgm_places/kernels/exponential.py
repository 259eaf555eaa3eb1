"""The exponential function of vectors of numbers that are not above zero.

NumPy's is a vector instruction at a time only where the processor has AVX-512; elsewhere it takes
a call for each number. This one takes the same operations, and gives the same bits, everywhere.
"""

from typing import Any

from pgm_places.kernels.jit import fused
from pgm_places.kernels.lanes import fma, largest, nearest_integer, power_of_two, select

__all__ = ["exponential"]

LOG2_E = float.fromhex("0x1.71547652b82fep+0")
LN_2, LN_2_REST = float.fromhex("0x1.62e42fefa39efp-1"), float.fromhex("0x1.abc9e3b39803fp-56")
LEAST = -708.0  # exponentials of numbers below are 0: subnormal numbers are slow

# (e**r - 1 - r) / r**2 where abs(r) <= ln(2) / 2: off by less than 2e-17 of e**r
C0, C1, C2, C3, C4, C5, C6, C7, C8, C9 = (
    0.5000000000000001,
    0.16666666666666669,
    0.04166666666662413,
    0.008333333333330062,
    0.0013888888917213717,
    0.00019841269863053618,
    2.4801521295954376e-05,
    2.7557268459997064e-06,
    2.7620088445409746e-07,
    2.510038549551032e-08,
)


@fused
def exponential(x: Any) -> Any:
    """``e**x`` of float64 lanes from -inf to 0, within 1.1 units of the last place; NaN stays NaN.

    ``x = n ln 2 + r``, and ``e**x = 2**n e**r``.
    """
    within = largest(LEAST, x)  # in this order, NaN stays NaN
    n = nearest_integer(within * LOG2_E)
    r = fma(n, -LN_2_REST, fma(n, -LN_2, within))
    r2 = r * r
    low = fma(fma(r, C3, C2), r2, fma(r, C1, C0))
    high = fma(fma(r, C7, C6), r2, fma(r, C5, C4))
    rest = fma(fma(fma(r, C9, C8), r2 * r2, high), r2 * r2, low)
    return select(x < LEAST, 0.0, (fma(rest, r2, r) + 1.0) * power_of_two(n))
