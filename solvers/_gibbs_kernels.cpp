// Kernel of Gibbs sampling.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;

// Draw every node in turn given its neighbours; `chance` (N,) in [0, 1).
//
// `labels` (N,) must be allowed, and stay so: every label that a node may keep has a chance.
template <int N>
void gibbs_sweep(Terms<N> terms, Arcs arcs, ConstRow chance, Array<std::int32_t, 1> labels) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> value(n_labels);
    for (int64_t i = 0; i < n_nodes; ++i) {
        for (int64_t k = 0; k < n_labels; ++k) value[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            add_edge(terms.pairwise, arcs.arc(slot), labels(arcs.head(slot)), value.data(), n_labels);
        double top = value[0], total = 0.0;
        for (int64_t k = 1; k < n_labels; ++k)
            if (value[k] > top) top = value[k];
        for (int64_t k = 0; k < n_labels; ++k) {
            value[k] = std::exp(value[k] - top);
            total += value[k];
        }
        double left = chance(i) * total;
        for (int64_t k = 0; k < n_labels; ++k) {
            if (!(value[k] > 0.0)) continue;
            labels(i) = static_cast<std::int32_t>(k);
            left -= value[k];
            if (left < 0.0) break;
        }
    }
}

template <int N> void add_all(Module &module) {
    module.add("gibbs_sweep", gibbs_sweep<N>, "terms"_a, "arcs"_a, "chance"_a, "labels"_a);
}

}  // namespace

PGM_KERNELS(module) {
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
