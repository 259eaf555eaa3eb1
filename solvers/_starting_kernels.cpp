// Log-probabilities of many nodes as probabilities.

#include <cmath>
#include <limits>

#include "pgm_places/kernels/exponential.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr int LANES = 16;
constexpr int64_t NODES_AT_ONCE = 512;  // whose numbers stay in the nearest cache

// Divide some numbers by their sum.
PGM_INLINE void divide(double *row, int64_t count) {
    double total = 0.0;
    for (int64_t k = 0; k < count; ++k) total += row[k];
    const double factor = 1.0 / total;
    for (int64_t k = 0; k < count; ++k) row[k] *= factor;
}

// Write the probabilities of all nodes to `out` (N K + 16,), one node's behind the other's.
//
// Those that are not 0 are raised to `floor`. Returns the first node whose labels are all forbidden,
// or -1; it and later nodes are left out then.
struct Normalise {
    template <int BYTES>
    static PGM_INLINE int64_t run(Array<const double, 2> unary, double floor, Array<double, 1> out) {
        using L = pgm::Simd<double, LANES, BYTES>;
        constexpr double INF = std::numeric_limits<double>::infinity();
        const int64_t n_nodes = unary.shape(0), n_labels = unary.shape(1);
        const double *given = unary.data();
        for (int64_t begin = 0; begin < n_nodes; begin += NODES_AT_ONCE) {
            const int64_t end = std::min(begin + NODES_AT_ONCE, n_nodes);
            for (int64_t i = begin; i < end; ++i) {
                double best = -INF;
                for (int64_t k = 0; k < n_labels; ++k) best = std::max(best, given[i * n_labels + k]);
                if (best == -INF) return i;
                for (int64_t k = 0; k < n_labels; ++k)
                    out.data()[i * n_labels + k] = given[i * n_labels + k] - best;
            }
            for (int64_t at = begin * n_labels; at < end * n_labels; at += LANES)
                exponential(L::load(out.data() + at)).store(out.data() + at);
            for (int64_t i = begin; i < end; ++i) {
                double *row = out.data() + i * n_labels;
                divide(row, n_labels);
                if (!(floor > 0.0)) continue;
                for (int64_t k = 0; k < n_labels; ++k)
                    if (given[i * n_labels + k] > -INF) row[k] = std::max(row[k], floor);
                divide(row, n_labels);
            }
        }
        return -1;
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("starting_probabilities", pgm::variants<Normalise>, "unary"_a, "floor"_a, "out"_a);
}
