// Sums for max-margin learning.

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;
using Labels = Array<const int64_t, 1>;
using ConstMatrix = Array<const double, 2>;
using Matrix = Array<double, 2>;

// Add phi(truth) - phi(labels) to `nodes_out` (D, K) and `edges_out` (F, K).
//
// Only nodes and edges where the labellings differ are looked at, which are few near the end.
void add_feature_difference(Labels labels, Labels truth, ConstMatrix node_features,
                            Array<const std::int32_t, 2> edges, ConstMatrix edge_features,
                            Matrix nodes_out, Matrix edges_out) {
    for (int64_t i = 0; i < labels.shape(0); ++i) {
        const int64_t k = labels(i), t = truth(i);
        if (k == t) continue;
        for (int64_t d = 0; d < node_features.shape(1); ++d) {
            const double value = node_features(i, d);
            nodes_out(d, t) += value;
            nodes_out(d, k) -= value;
        }
    }
    for (int64_t e = 0; e < edges.shape(0); ++e) {
        const int64_t i = edges(e, 0), j = edges(e, 1), k = labels(i), t = truth(i);
        if (k == t && labels(j) == truth(j)) continue;
        if (truth(j) == t)
            for (int64_t f = 0; f < edge_features.shape(1); ++f) edges_out(f, t) += edge_features(e, f);
        if (labels(j) == k)
            for (int64_t f = 0; f < edge_features.shape(1); ++f) edges_out(f, k) -= edge_features(e, f);
    }
}

// Write the products of `rows` (N, D) and `weights` (D, K) one after the other to `out`.
//
// `weights` (D, P) are padded to P, a multiple of four; what that writes behind a row is overwritten by
// the next, so that `out` (N K + P,) ends with some room.
struct MultiplyRows {
    template <int BYTES>
    static PGM_INLINE void run(ConstMatrix rows, ConstMatrix weights, Array<double, 1> out) {
        using Four = pgm::Simd<double, 4, BYTES>;
        const int64_t n_rows = rows.shape(0), n_features = rows.shape(1), width = weights.shape(1);
        const int64_t n_columns = (out.shape(0) - width) / std::max<int64_t>(n_rows, 1);
        for (int64_t i = 0; i < n_rows; ++i)
            for (int64_t g = 0; g < width; g += 4) {
                Four total = Four::splat(0.0);
                for (int64_t d = 0; d < n_features; ++d)
                    total = total + Four::load(weights.data() + d * width + g) *
                                        Four::splat(rows.data()[i * n_features + d]);
                total.store(out.data() + i * n_columns + g);
            }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("add_feature_difference", add_feature_difference, "labels"_a, "truth"_a,
               "node_features"_a, "edges"_a, "edge_features"_a, "nodes_out"_a, "edges_out"_a);
    module.add("multiply_rows", pgm::variants<MultiplyRows>, "rows"_a, "weights"_a, "out"_a);
}
