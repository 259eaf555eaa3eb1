// The weights of the examples of a binary problem, as the kernels of boosting share them.
//
// Signed masses are the weights as whole numbers, negative for negative examples, zero for examples
// that take no part, so every sum is exact in whatever order it is taken.

#pragma once

#include "pgm_places/kernels/registry.hpp"

namespace pgm {

struct Weights {  // see stump_search.py
    Array<double, 1> weights;
    Array<std::int64_t, 1> masses;
    Array<const bool, 1> included;
    Array<const std::int64_t, 2> segments;
    Array<std::int64_t, 1> sums;
    auto fields() { return std::tie(weights, masses, included, segments, sums); }

    // The sum of the signed masses,
    std::int64_t total() const { return sums(1) + sums(0); }
    // and of all masses.
    std::int64_t mass() const { return sums(1) - sums(0); }
};

struct Changes {  // see stump_search.py
    Array<std::uint32_t, 1> positions;
    Array<std::int64_t, 1> changes;
    Array<std::int64_t, 2> spans;
    auto fields() { return std::tie(positions, changes, spans); }
};

struct Histograms {  // see stump_search.py
    Array<std::int64_t, 2> positive, negative;
    auto fields() { return std::tie(positive, negative); }
};

}  // namespace pgm
