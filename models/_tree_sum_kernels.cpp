// The sums of trees that classifiers are made of.

#include "models/column_gather.hpp"

namespace {

using pgm::Array;
using pgm::BLOCK;
using std::int64_t;

constexpr int AT_ONCE = 16;  // samples

struct Trees {  // see strong_classifier.py
    Array<const int64_t, 1> columns;
    Array<const int64_t, 2> plane;
    Array<const float, 2> cut, value;
    Array<const int64_t, 1> first;
    auto fields() { return std::tie(columns, plane, cut, value, first); }
};

// What the subtree at split `s` of a tree says of some samples; with no levels, it is a leaf.
template <int LEVELS, class L>
PGM_INLINE L said(const Trees &trees, int64_t t, int64_t s, const float *samples) {
    const int64_t n_splits = trees.plane.shape(1);
    if constexpr (LEVELS == 0) {
        return L::splat(trees.value(t, s - n_splits));
    } else {
        const L left = said<LEVELS - 1, L>(trees, t, 2 * s + 1, samples);
        const L right = said<LEVELS - 1, L>(trees, t, 2 * s + 2, samples);
        return select(L::load(samples + trees.plane(t, s) * BLOCK) < trees.cut(t, s), left, right);
    }
}

// Add to `total` (BLOCK,) what the trees of group `k` say of the samples in `values`.
template <int LEVELS, int BYTES>
PGM_INLINE void add_group(const Trees &trees, int64_t k, const float *values, double *total) {
    using L = pgm::Simd<float, AT_ONCE, pgm::COMPARED<BYTES>>;
    using Sums = pgm::Simd<double, AT_ONCE, pgm::COMPARED<BYTES>>;
    for (int64_t t = trees.first(k); t < trees.first(k + 1); ++t)
        for (int i = 0; i < BLOCK; i += AT_ONCE)
            (Sums::load(total + i) + widen(said<LEVELS, L>(trees, t, 0, values + i))).store(total + i);
}

// Write `out(k, n)`, the sum over the trees of group `k` of the leaf that row `n` falls into.
//
// All splits of a tree are worked out for all samples of a block, from the leaves up: comparisons and
// choices of whole vectors, no branches. Trees are added in their order, so one group's bits depend
// on nothing else.
struct SumTrees {
    template <int BYTES>
    static PGM_INLINE void run(Array<const float, 2> X, int64_t start, int64_t stop, Trees trees,
                               Array<double, 2> out) {
        const int64_t n_splits = trees.plane.shape(1);
        pgm::score_blocks<BYTES>(
            X, start, stop, trees.columns, out,
            [&](int64_t k, const float *values, double *total) PGM_INLINE_LAMBDA {
                if (n_splits == 3)
                    add_group<2, BYTES>(trees, k, values, total);
                else if (n_splits == 7)
                    add_group<3, BYTES>(trees, k, values, total);
                else
                    add_group<4, BYTES>(trees, k, values, total);
            });
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("sum_trees", pgm::variants<SumTrees>, "X"_a, "start"_a, "stop"_a, "trees"_a, "out"_a);
}
