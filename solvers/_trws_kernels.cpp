// Kernels of sequential tree-reweighted message passing.
//
// Nodes are visited in index order and back. An edge keeps one message, the one towards the node that
// is visited next: on the way up it is written by the lower node and read by the upper one, on the way
// back the other way round. What the normalisation takes out on the way back adds up to the bound.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;

// Write 1 / max(lower neighbours, upper neighbours): how a node splits among its chains.
void share_of_nodes(Arcs arcs, Row share) {
    for (int64_t i = 0; i < share.shape(0); ++i) {
        int64_t below = 0, above = 0;
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            arcs.head(slot) < i ? ++below : ++above;
        share(i) = 1.0 / static_cast<double>(std::max<int64_t>({below, above, 1}));
    }
}

// Renew the message of an arc's edge; the largest entry, which is taken out, -inf if all are.
//
// With a reward only for agreeing, the message of a label is the larger of its own value plus the
// reward and the best of the other labels: O(K), as it is where tables fall with the distance of
// labels; O(K^2) for other tables.
template <int N>
double pass_on(const double *belief, Arc arc, const Array<const double, N> &pairwise, double *message,
               double *sent, int64_t n_labels) {
    double top = -INF;
    if constexpr (N == 2) {
        double first = -INF, second = -INF;
        for (int64_t k = 0; k < n_labels; ++k) {
            const double value = belief[k] - message[k];
            message[k] = value;
            if (value > first) {
                second = first;
                first = value;
            } else if (value > second) {
                second = value;
            }
        }
        for (int64_t k = 0; k < n_labels; ++k) {
            double value = message[k];
            const double other = value < first ? first : second;
            value += pairwise(arc >> 1, k);
            value = value > other ? value : other;
            message[k] = value;
            if (value > top) top = value;
        }
    } else {
        // A label that is impossible stays so whatever came back for it.
        for (int64_t k = 0; k < n_labels; ++k)
            sent[k] = belief[k] > -INF ? belief[k] - message[k] : -INF;
        if constexpr (N == 1) {
            max_of_distances(sent, arc, pairwise, message, n_labels);
            for (int64_t k = 0; k < n_labels; ++k)
                if (message[k] > top) top = message[k];
        } else {
            const int64_t at = table_at(pairwise, arc);
            for (int64_t other = 0; other < n_labels; ++other) {
                double value = -INF;
                for (int64_t k = 0; k < n_labels; ++k) {
                    const double pair = arc & 1 ? pairwise(at, other, k) : pairwise(at, k, other);
                    if (sent[k] + pair > value) value = sent[k] + pair;
                }
                message[other] = value;
                if (value > top) top = value;
            }
        }
        if (top == -INF) return top;
    }
    for (int64_t k = 0; k < n_labels; ++k) message[k] -= top;
    return top;
}

// One pass over all nodes; the sum of what was taken out of beliefs and messages.
//
// It is -inf if no labelling is possible.
template <int N>
double pass_over_nodes(bool upwards, Terms<N> terms, Arcs arcs, ConstRow share, Matrix message) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> belief(n_labels), sent(n_labels);
    double total = 0.0, lost = 0.0;  // what rounding has cut off the total so far (Kahan)
    for (int64_t step = 0; step < n_nodes; ++step) {
        const int64_t i = upwards ? step : n_nodes - 1 - step;
        for (int64_t k = 0; k < n_labels; ++k) belief[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const double *of_edge = &message(arcs.arc(slot) >> 1, 0);
            for (int64_t k = 0; k < n_labels; ++k) belief[k] += of_edge[k];
        }
        double taken = belief[0];
        for (int64_t k = 1; k < n_labels; ++k)
            if (belief[k] > taken) taken = belief[k];
        if (taken == -INF) return -INF;
        for (int64_t k = 0; k < n_labels; ++k) belief[k] = (belief[k] - taken) * share(i);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            if ((arcs.head(slot) > i) != upwards) continue;
            const Arc arc = arcs.arc(slot);
            const double top = pass_on(belief.data(), arc, terms.pairwise, &message(arc >> 1, 0),
                                       sent.data(), n_labels);
            if (top == -INF) return -INF;
            taken += top;
        }
        const double kept = taken - lost, grown = total + kept;
        lost = (grown - total) - kept;
        total = grown;
    }
    return total;
}

// Set the label that `known` and the messages from above favour; its part of `known`.
double take_best(int64_t i, const std::vector<double> &known, const Arcs &arcs,
                 const ConstMatrix &message, const Array<std::int32_t, 1> &labels) {
    std::int32_t best = 0;
    double best_value = -INF;
    for (std::int32_t k = 0; k < static_cast<std::int32_t>(known.size()); ++k) {
        double value = known[k];
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            if (arcs.head(slot) > i) value += message(arcs.arc(slot) >> 1, k);
        if (value > best_value) {
            best_value = value;
            best = k;
        }
    }
    labels(i) = best;
    return known[best];
}

// Label the nodes one after the other by what came back from above; the labelling's score.
template <int N>
double decode_nodes(Terms<N> terms, Arcs arcs, ConstMatrix message, Array<std::int32_t, 1> labels) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    std::vector<double> known(n_labels);
    double score = 0.0;
    for (int64_t i = 0; i < n_nodes; ++i) {
        for (int64_t k = 0; k < n_labels; ++k) known[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            if (arcs.head(slot) < i)
                add_edge(terms.pairwise, arcs.arc(slot), labels(arcs.head(slot)), known.data(),
                         n_labels);
        score += take_best(i, known, arcs, message, labels);
    }
    return score;
}

template <int N> void add_all(Module &module) {
    module.add("pass_over_nodes", pass_over_nodes<N>, "upwards"_a, "terms"_a, "arcs"_a, "share"_a,
               "message"_a);
    module.add("decode_nodes", decode_nodes<N>, "terms"_a, "arcs"_a, "message"_a, "labels"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("share_of_nodes", share_of_nodes, "arcs"_a, "share"_a);
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
