// The score of a labelling, and single messages, as tests look at them.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;

// The unaries of all nodes plus the potentials of all edges; `ends` (2 E,) own the arcs.
template <int N>
double score_labels(Terms<N> terms, Array<const std::uint32_t, 1> ends,
                    Array<const std::int32_t, 1> labels) {
    double total = 0.0;
    for (std::int64_t i = 0; i < labels.shape(0); ++i) total += terms.unary(i, labels(i));
    for (std::int64_t edge = 0; edge < ends.shape(0) / 2; ++edge) {
        const Arc arc = static_cast<Arc>(2 * edge);
        total += edge_score(terms.pairwise, arc, labels(ends(arc)), labels(ends(arc + 1)));
    }
    return total;
}

template <int N> void one_maximum(ConstRow sent, Arc arc, Array<const double, N> pairwise, Row out) {
    pass_max(sent.data(), arc, pairwise, out.data(), out.size());
}

template <int N> double one_sum(ConstRow sent, Arc arc, Array<const double, N> pairwise, Row out) {
    return pass_sum(sent.data(), arc, pairwise, out.data(), out.size());
}

template <int N>
double one_edge(Array<const double, N> pairwise, Arc arc, std::int64_t mine, std::int64_t theirs) {
    return edge_score(pairwise, arc, mine, theirs);
}

void one_envelope(ConstRow sent, Arc arc, ConstRow distances, Row out) {
    max_of_distances(sent.data(), arc, distances, out.data(), out.size());
}

template <int N> void add_all(Module &module) {
    module.add("score_labels", score_labels<N>, "terms"_a, "ends"_a, "labels"_a);
    module.add("edge_score", one_edge<N>, "pairwise"_a, "arc"_a, "mine"_a, "theirs"_a);
    module.add("pass_max", one_maximum<N>, "sent"_a, "arc"_a, "pairwise"_a, "out"_a);
    if constexpr (N > 1)
        module.add("pass_sum", one_sum<N>, "sent"_a, "arc"_a, "pairwise"_a, "out"_a);
}

}  // namespace

PGM_KERNELS(module) {
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
    module.add("max_of_distances", one_envelope, "sent"_a, "arc"_a, "distances"_a, "out"_a);
}
