// The sums of stumps that classifiers are made of.

#include "models/column_gather.hpp"

namespace {

using pgm::Array;
using pgm::BLOCK;
using std::int64_t;

struct Stumps {  // see the table of votes in strong_classifier.py
    Array<const int64_t, 1> columns, plane;
    Array<const float, 1> cut;
    Array<const double, 1> vote;
    Array<const int64_t, 1> first;
    auto fields() { return std::tie(columns, plane, cut, vote, first); }
};

// Add to `total` (BLOCK,) the votes of group `k` on the samples in `values`.
template <int BYTES>
PGM_INLINE void add_group(const Stumps &stumps, int64_t k, const float *values, double *total) {
    constexpr int AT_ONCE = BYTES;  // samples, whose sums stay in registers
    using Values = pgm::Simd<float, AT_ONCE, pgm::COMPARED<BYTES>>;
    using Sums = pgm::Simd<double, AT_ONCE, pgm::COMPARED<BYTES>>;
    for (int i = 0; i < BLOCK; i += AT_ONCE) {
        Sums sum = Sums::load(total + i);
        for (int64_t t = stumps.first(k); t < stumps.first(k + 1); ++t) {
            const Values x = Values::load(values + stumps.plane(t) * BLOCK + i);
            const Sums vote = Sums::splat(stumps.vote(t)), other = Sums::splat(-stumps.vote(t));
            sum = sum + select(widen(x) < stumps.cut(t), vote, other);
        }
        sum.store(total + i);
    }
}

// Write `out(k, n)`, the sum of `vote` where row `n` is under `cut`, else `-vote`, over group `k`.
//
// Group `k` are the stumps `first[k]` to `first[k + 1]`. Votes are added in their order, so one
// group's bits depend on nothing else.
struct SumVotes {
    template <int BYTES>
    static PGM_INLINE void run(Array<const float, 2> X, int64_t start, int64_t stop, Stumps stumps,
                               Array<double, 2> out) {
        pgm::score_blocks<BYTES>(
            X, start, stop, stumps.columns, out,
            [&](int64_t k, const float *values, double *total) PGM_INLINE_LAMBDA {
                add_group<BYTES>(stumps, k, values, total);
            });
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("sum_votes", pgm::variants<SumVotes>, "X"_a, "start"_a, "stop"_a, "stumps"_a, "out"_a);
}
