// Kernel that rules labels out: those that another label of the node beats whatever happens.
//
// Label `l` is dead at `i` if, for some label `c`, `unary[i, l] - unary[i, c]` plus the most that every
// edge can favour `l` over `c` is negative (Goldstein's dead-end elimination). No best labelling then
// holds it, and what the neighbours can do shrinks in turn.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;

constexpr double ROUNDING = 1e-12;  // ruled out only by more than this share of what is compared

struct Alive {  // see elimination.py
    Array<bool, 2> labels;
    Array<std::int32_t, 1> n_labels;
    auto fields() { return std::tie(labels, n_labels); }
};

// The label with the largest score that no neighbour can take away.
int64_t surest_label(int64_t i, const Terms<2> &terms, const Arcs &arcs, const Alive &left,
                     std::vector<double> &sure) {
    const int64_t n_labels = terms.unary.shape(1);
    for (int64_t k = 0; k < n_labels; ++k) sure[k] = terms.unary(i, k);
    for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
        const int64_t j = arcs.head(slot), edge = arcs.arc(slot) >> 1;
        for (int64_t k = 0; k < n_labels; ++k)
            if (left.labels(j, k) && (terms.pairwise(edge, k) < 0.0 || left.n_labels(j) == 1))
                sure[k] += terms.pairwise(edge, k);
    }
    int64_t best = -1;
    for (int64_t k = 0; k < n_labels; ++k)
        if (left.labels(i, k) && (best < 0 || sure[k] > sure[best])) best = k;
    return best;
}

bool is_beaten(int64_t i, int64_t label, int64_t best, const Terms<2> &terms, const Arcs &arcs,
               const Alive &left) {
    const auto &[unary, agreement] = terms;
    double lead = unary(i, label) - unary(i, best);
    double size = std::fabs(unary(i, label)) + std::fabs(unary(i, best));
    for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
        const int64_t j = arcs.head(slot), edge = arcs.arc(slot) >> 1;
        std::int32_t others = left.n_labels(j);
        double most = -INF;
        if (left.labels(j, label)) {
            others -= 1;
            most = agreement(edge, label);
        }
        if (left.labels(j, best)) {
            others -= 1;
            if (-agreement(edge, best) > most) most = -agreement(edge, best);
        }
        if (others > 0 && most < 0.0) most = 0.0;
        lead += most;
        size += std::fabs(most);
    }
    return lead < -ROUNDING * size;
}

// Leave the labels that are not dead, until no more are found; for rewards of agreement.
//
// `ring` and `waiting` (N,) are working arrays.
void eliminate_labels(Terms<2> terms, Arcs arcs, Alive left, Array<std::uint32_t, 1> ring,
                      Array<bool, 1> waiting) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> sure(n_labels);
    for (int64_t i = 0; i < n_nodes; ++i) {
        left.n_labels(i) = 0;
        for (int64_t k = 0; k < n_labels; ++k) {
            left.labels(i, k) = terms.unary(i, k) > -INF;
            left.n_labels(i) += left.labels(i, k);
        }
        ring(i) = static_cast<std::uint32_t>(i);
        waiting(i) = true;
    }
    int64_t first = 0, n_waiting = n_nodes;
    while (n_waiting > 0) {
        const int64_t i = ring(first);
        first = first + 1 < n_nodes ? first + 1 : 0;
        n_waiting -= 1;
        waiting(i) = false;
        if (left.n_labels(i) <= 1) continue;
        const int64_t best = surest_label(i, terms, arcs, left, sure);
        bool found = false;
        for (int64_t label = 0; label < n_labels; ++label) {
            if (label == best || !left.labels(i, label)) continue;
            if (is_beaten(i, label, best, terms, arcs, left)) {
                left.labels(i, label) = false;
                left.n_labels(i) -= 1;
                found = true;
            }
        }
        if (!found) continue;
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const std::uint32_t j = arcs.head(slot);
            if (waiting(j)) continue;
            waiting(j) = true;
            const int64_t last = first + n_waiting;
            ring(last < n_nodes ? last : last - n_nodes) = j;
            n_waiting += 1;
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("eliminate_labels", eliminate_labels, "terms"_a, "arcs"_a, "left"_a, "ring"_a,
               "waiting"_a);
}
