// The exponential function of vectors of numbers that are not above zero.
//
// It has the same bits on every machine, unlike the system's function.

#pragma once

#include "pgm_places/kernels/simd.hpp"

namespace pgm {

// `e**x` of float64 lanes from -inf to 0, within 1.1 units of the last place; NaN stays NaN.
//
// `x = n ln 2 + r`, and `e**x = 2**n e**r`.
template <int N, int B> PGM_INLINE Simd<double, N, B> exponential(Simd<double, N, B> x) {
    using L = Simd<double, N, B>;
    const auto number = [](double value) { return L::splat(value); };
    const L least = number(-708.0);  // those of numbers below are 0: subnormal numbers are slow
    const L within = largest(least, x);  // in this order, NaN stays NaN
    const L n = nearest_integer(within * number(0x1.71547652b82fep+0));
    const L minus_ln_2 = number(-0x1.62e42fefa39efp-1), minus_rest = number(-0x1.abc9e3b39803fp-56);
    const L r = fma(n, minus_rest, fma(n, minus_ln_2, within));
    const L r2 = r * r;
    // (e**r - 1 - r) / r**2 where abs(r) <= ln(2) / 2: off by less than 2e-17 of e**r
    const L low = fma(fma(r, number(0.008333333333330062), number(0.04166666666662413)), r2,
                      fma(r, number(0.16666666666666669), number(0.5000000000000001)));
    const L high = fma(fma(r, number(2.7557268459997064e-06), number(2.4801521295954376e-05)), r2,
                       fma(r, number(0.00019841269863053618), number(0.0013888888917213717)));
    const L last = fma(r, number(2.510038549551032e-08), number(2.7620088445409746e-07));
    const L rest = fma(fma(last, r2 * r2, high), r2 * r2, low);
    return select(x < least, number(0.0), (fma(rest, r2, r) + number(1.0)) * power_of_two(n));
}

}  // namespace pgm
