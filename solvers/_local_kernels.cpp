// Kernels that improve one node at a time: iterated conditional modes and mean field.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;

constexpr double ROUNDING = 1e-12;  // a gain below this share of its terms is rounding

// Give every node in turn its best label among its neighbours'; how many changed.
template <int N> int64_t modes_pass(Terms<N> terms, Arcs arcs, Array<std::int32_t, 1> labels) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> value(n_labels);
    int64_t n_changed = 0;
    for (int64_t i = 0; i < n_nodes; ++i) {
        double size = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) value[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            size += add_edge(terms.pairwise, arcs.arc(slot), labels(arcs.head(slot)), value.data(),
                             n_labels);
        int64_t best = labels(i);
        for (int64_t k = 0; k < n_labels; ++k)
            if (value[k] > value[best]) best = k;
        const double gain = value[best] - value[labels(i)];
        size += std::fabs(value[best]) + std::fabs(value[labels(i)]);
        if (gain > ROUNDING * size || gain == INF) {
            labels(i) = static_cast<std::int32_t>(best);
            n_changed += 1;
        }
    }
    return n_changed;
}

// Update every node's beliefs in turn from its neighbours'; the largest change.
//
// `q_i(k) ~ exp(unary[i, k] + sum_j sum_l q_j(l) pairwise(k, l))`.
template <int N> double mean_field_pass(double damping, Terms<N> terms, Arcs arcs, Matrix beliefs) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> value(n_labels);
    double largest = 0.0;
    for (int64_t i = 0; i < n_nodes; ++i) {
        for (int64_t k = 0; k < n_labels; ++k) value[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            add_expected(terms.pairwise, arcs.arc(slot), &beliefs(arcs.head(slot), 0), value.data(),
                         n_labels);
        double top = value[0];
        for (int64_t k = 1; k < n_labels; ++k)
            if (value[k] > top) top = value[k];
        // The neighbours together may forbid every label: then the node keeps its beliefs.
        if (top == -INF) continue;
        double total = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) {
            value[k] = std::exp(value[k] - top);
            total += value[k];
        }
        for (int64_t k = 0; k < n_labels; ++k) {
            const double fresh = (1.0 - damping) * value[k] / total + damping * beliefs(i, k);
            const double change = std::fabs(fresh - beliefs(i, k));
            if (change > largest) largest = change;
            beliefs(i, k) = fresh;
        }
    }
    return largest;
}

template <int N> void add_all(Module &module) {
    module.add("modes_pass", modes_pass<N>, "terms"_a, "arcs"_a, "labels"_a);
    if constexpr (N > 1)
        module.add("mean_field_pass", mean_field_pass<N>, "damping"_a, "terms"_a, "arcs"_a,
                   "beliefs"_a);
}

}  // namespace

PGM_KERNELS(module) {
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
