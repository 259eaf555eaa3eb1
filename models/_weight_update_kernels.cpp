// The weights of examples: rounding them to masses, making some heavier.

#include <cmath>

#include "models/weighted_examples.hpp"

namespace {

using pgm::Array;
using pgm::Changes;
using pgm::Weights;
using std::int64_t;

// Which examples a stump puts on its left: those with `codes` under `below`, and in bin `mixed` those
// with a value under `threshold`.
struct Split {
    Array<const std::uint8_t, 1> codes;
    Array<const float, 2> X;
    Array<const int64_t, 1> rows;  // of X
    int64_t column, below, mixed;
    double threshold;
    int64_t left_side;  // 1 where the stump says positive on the left, else 0
    auto fields() {
        return std::tie(codes, X, rows, column, below, mixed, threshold, left_side);
    }

    bool has_on_left(int64_t n) const {
        return codes(n) == mixed ? X(rows(n), column) < threshold : codes(n) < below;
    }
};

// Scale weights to the sum `whole`, round them to masses, and list all as changes from zero.
//
// Returns the number of changes.
int64_t weigh_all(double whole, Weights weighed, Changes changed) {
    const auto &[weights, masses, included, segments, sums] = weighed;
    double total = 0.0;
    for (int64_t s = 0; s < segments.shape(0); ++s)
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) total += weights(n);
    const double scale = whole / total;
    sums(0) = sums(1) = 0;
    int64_t count = 0;
    for (int64_t s = 0; s < segments.shape(0); ++s) {
        const int64_t side = segments(s, 2), sign = side == 1 ? 1 : -1;
        changed.spans(s, 0) = count;
        changed.spans(s, 2) = side;
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            weights(n) *= scale;
            masses(n) = sign * std::llrint(weights(n));
            sums(side) += masses(n);
            changed.positions(count) = static_cast<std::uint32_t>(n);
            changed.changes(count++) = masses(n);
        }
        changed.spans(s, 1) = count;
    }
    return count;
}

// Make wrongly classified examples heavier than the others by the factor `rise`.
//
// Either their weights are multiplied or those of the others divided, whichever are fewer: a common
// factor of all weights does not matter. Lists the changed masses and returns how many there are;
// `wrong` (N,) is scratch.
int64_t reweigh(Split split, double rise, Array<bool, 1> wrong, Weights weighed, Changes changed) {
    const auto &[weights, masses, included, segments, sums] = weighed;
    int64_t n_wrong = 0, n_all = 0;
    for (int64_t s = 0; s < segments.shape(0); ++s) {
        const bool right_on_left = segments(s, 2) == split.left_side;
        n_all += segments(s, 1) - segments(s, 0);
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            wrong(n) = split.has_on_left(n) != right_on_left;
            n_wrong += wrong(n);
        }
    }
    const bool changing = 2 * n_wrong <= n_all;
    const double factor = changing ? rise : 1.0 / rise;
    int64_t count = 0;
    for (int64_t s = 0; s < segments.shape(0); ++s) {
        const int64_t side = segments(s, 2), sign = side == 1 ? 1 : -1;
        changed.spans(s, 0) = count;
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            if (wrong(n) != changing) continue;
            weights(n) *= factor;
            const int64_t mass = sign * std::llrint(weights(n)), change = mass - masses(n);
            changed.positions(count) = static_cast<std::uint32_t>(n);
            changed.changes(count++) = change;
            sums(side) += change;
            masses(n) = mass;
        }
        changed.spans(s, 1) = count;
    }
    return count;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("weigh_all", weigh_all, "whole"_a, "weighed"_a, "changed"_a);
    module.add("reweigh", reweigh, "split"_a, "rise"_a, "wrong"_a, "weighed"_a, "changed"_a);
}
