// Kernels of exact sums on a forest in probability space, where nothing needs an exponential.
//
// A node's message to its parent is scaled to sum to one. `inner` (N, K) is what a node and all below
// it say of its label, `outer` (N, K) what the rest says of its parent's; their product and the
// exponential of the edge's potential is the probability of a pair of labels.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;
using Order = Array<const std::uint32_t, 1>;

constexpr Arc NO_ARC = 0xffffffff;  // the parent arc of a root

// Rows (N, K) less their largest entry, which goes to `peak`; how deep finite ones go.
double subtract_peaks(ConstMatrix unary, Matrix out, Row peak) {
    double deepest = 0.0;
    for (int64_t i = 0; i < unary.shape(0); ++i) {
        peak(i) = unary(i, 0);
        for (int64_t k = 1; k < unary.shape(1); ++k) peak(i) = std::max(peak(i), unary(i, k));
        for (int64_t k = 0; k < unary.shape(1); ++k) {
            out(i, k) = unary(i, k) - peak(i);
            if (deepest > out(i, k) && out(i, k) > -INF) deepest = out(i, k);
        }
    }
    return deepest;
}

// `out[b] = sum_a sent[a] exp(potential(a, b))` along an arc, from its owner to its head.
template <int N>
void pass(const Array<const double, N> &gain, Arc along, const double *sent, double *out,
          int64_t n_labels) {
    if constexpr (N == 2) {
        double total = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) total += sent[k];
        for (int64_t k = 0; k < n_labels; ++k) out[k] = total + gain(along >> 1, k) * sent[k];
    } else {
        const int64_t at = gain.shape(0) > 2 ? along : along & 1;
        for (int64_t b = 0; b < n_labels; ++b) out[b] = sent[0] * gain(at, 0, b);
        for (int64_t a = 1; a < n_labels; ++a)
            for (int64_t b = 0; b < n_labels; ++b) out[b] += sent[a] * gain(at, a, b);
    }
}

// Messages (N, K) from each node to its parent, from the leaves to the roots.
//
// `gain` is `exp(potential)` by arc, (2 E, K, K) or (2, K, K) for all edges, owner's label first; or
// `exp(agreement) - 1`, (E, K). `inner` starts as the exponentials of the unary. The product of all
// `scale` (N,) is the sum over all labellings.
template <int N>
void collect_sums(Array<const double, N> gain, Arcs arcs, Order order, Order parent, Matrix inner,
                  Matrix message, Row scale) {
    const int64_t n_labels = inner.shape(1);
    for (int64_t step = order.shape(0) - 1; step >= 0; --step) {
        const int64_t i = order(step);
        const Arc along = parent(i);
        double total = 0.0;
        if (along == NO_ARC) {
            for (int64_t k = 0; k < n_labels; ++k) total += inner(i, k);
            scale(i) = total;
            continue;
        }
        pass(gain, along, &inner(i, 0), &message(i, 0), n_labels);
        for (int64_t k = 0; k < n_labels; ++k) total += message(i, k);
        scale(i) = total;
        const int64_t above = arcs.ends(along ^ REVERSE);
        const double factor = 1.0 / total;
        for (int64_t k = 0; k < n_labels; ++k) {
            message(i, k) *= factor;
            inner(above, k) *= message(i, k);
        }
    }
}

// Beliefs (N, K) from the roots to the leaves, after `collect_sums`.
//
// `message` becomes `outer`; it stays what it is at roots.
template <int N>
void distribute_sums(Array<const double, N> gain, Arcs arcs, Order order, Order parent,
                     ConstMatrix inner, Matrix message, Matrix belief) {
    const int64_t n_labels = inner.shape(1);
    std::vector<double> back(n_labels);
    for (const std::uint32_t i : order) {
        const Arc along = parent(i);
        std::fill(back.begin(), back.end(), 1.0);
        if (along != NO_ARC) {
            const int64_t above = arcs.ends(along ^ REVERSE);
            for (int64_t k = 0; k < n_labels; ++k) message(i, k) = belief(above, k) / message(i, k);
            pass(gain, along ^ REVERSE, &message(i, 0), back.data(), n_labels);
        }
        double total = 0.0;
        for (int64_t k = 0; k < n_labels; ++k) {
            // What is ruled out below may be told to be infinitely likely from above.
            belief(i, k) = inner(i, k) > 0.0 ? inner(i, k) * back[k] : 0.0;
            total += belief(i, k);
        }
        const double factor = 1.0 / total;
        for (int64_t k = 0; k < n_labels; ++k) {
            belief(i, k) *= factor;
            message(i, k) *= factor;
        }
    }
}

template <int N> void add_all(Module &module) {
    module.add("collect_sums", collect_sums<N>, "gain"_a, "arcs"_a, "order"_a, "parent"_a, "inner"_a,
               "message"_a, "scale"_a);
    module.add("distribute_sums", distribute_sums<N>, "gain"_a, "arcs"_a, "order"_a, "parent"_a,
               "inner"_a, "message"_a, "belief"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("subtract_peaks", subtract_peaks, "unary"_a, "out"_a, "peak"_a);
    add_all<2>(module);
    add_all<3>(module);
}
