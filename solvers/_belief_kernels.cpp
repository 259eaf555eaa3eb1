// Kernels of belief propagation: sweeps on any graph, two exact passes on a forest.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;
using Numbers = std::vector<double>;
using Order = Array<const std::uint32_t, 1>;

constexpr Arc NO_ARC = 0xffffffff;  // the parent arc of a root

struct Rule {  // see belief_propagation.py
    bool maximise;
    double damping;
    auto fields() { return std::tie(maximise, damping); }
};

// `out` (K,) becomes the node's unary plus what all its neighbours say.
template <class M>
void gather_beliefs(const ConstMatrix &unary, const Arcs &arcs, const M &message, int64_t i,
                    Numbers &out) {
    const int64_t n_labels = unary.shape(1);
    for (int64_t k = 0; k < n_labels; ++k) out[k] = unary(i, k);
    for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
        const double *incoming = &message(arcs.arc(slot) ^ REVERSE, 0);
        for (int64_t k = 0; k < n_labels; ++k) out[k] += incoming[k];
    }
}

// The message `out` (K,) along an arc: the owner's belief without what came from there.
template <int N>
double send(bool maximise, Arc along, const Numbers &belief, const Array<const double, N> &pairwise,
            const Matrix &message, Numbers &sent, double *out) {
    const int64_t n_labels = message.shape(1);
    const double *back = &message(along ^ REVERSE, 0);
    // A label that is impossible stays so whatever came back for it.
    for (int64_t k = 0; k < n_labels; ++k) sent[k] = belief[k] > -INF ? belief[k] - back[k] : -INF;
    if (!maximise) return pass_sum(sent.data(), along, pairwise, out, n_labels);
    pass_max(sent.data(), along, pairwise, out, n_labels);
    return 0.0;
}

// Renew all messages, node by node in index order or back; the largest change of one.
//
// `message` (2 E, K) is per arc, each with 0 as its largest entry.
template <int N>
double message_sweep(bool upwards, Rule rule, Terms<N> terms, Arcs arcs, Matrix message) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    Numbers belief(n_labels), sent(n_labels), fresh(n_labels);
    double largest = 0.0;
    for (int64_t step = 0; step < n_nodes; ++step) {
        const int64_t i = upwards ? step : n_nodes - 1 - step;
        gather_beliefs(terms.unary, arcs, message, i, belief);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const Arc along = arcs.arc(slot);
            send(rule.maximise, along, belief, terms.pairwise, message, sent, fresh.data());
            for (int64_t k = 0; k < n_labels; ++k) {
                const double before = message(along, k);
                if (fresh[k] == before) continue;
                if (fresh[k] > -INF && before > -INF)
                    fresh[k] = (1.0 - rule.damping) * fresh[k] + rule.damping * before;
                const double change = std::fabs(fresh[k] - before);
                if (change > largest) largest = change;
                message(along, k) = fresh[k];
            }
        }
    }
    return largest;
}

// `message_sweep` for rewards of agreement, one to three times as fast.
//
// For sums `gain` (E, K) is `exp(agreement) - 1`, finite and at least 0: then all terms are positive
// and nothing cancels. For maxima it is not used.
double agreement_sweep(bool upwards, Rule rule, Terms<2> terms, ConstMatrix gain, Arcs arcs,
                       Matrix message) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    Numbers belief(n_labels), sent(n_labels);
    double largest = 0.0;
    for (int64_t step = 0; step < n_nodes; ++step) {
        const int64_t i = upwards ? step : n_nodes - 1 - step;
        gather_beliefs(terms.unary, arcs, message, i, belief);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const Arc along = arcs.arc(slot), edge = along >> 1;
            const double *back = &message(along ^ REVERSE, 0);
            double first = -INF, second = -INF;
            for (int64_t k = 0; k < n_labels; ++k) {
                sent[k] = belief[k] - back[k];
                if (sent[k] > first) {
                    second = first;
                    first = sent[k];
                } else if (sent[k] > second) {
                    second = sent[k];
                }
            }
            if (rule.maximise) {
                for (int64_t k = 0; k < n_labels; ++k) {
                    const double other = sent[k] < first ? first : second;
                    const double value = sent[k] + terms.pairwise(edge, k);
                    sent[k] = value > other ? value : other;
                }
            } else {
                double total = 0.0;
                for (int64_t k = 0; k < n_labels; ++k) {
                    sent[k] = std::exp(sent[k] - first);
                    total += sent[k];
                }
                for (int64_t k = 0; k < n_labels; ++k)
                    sent[k] = std::log(total + sent[k] * gain(edge, k));
            }
            double top = sent[0];
            for (int64_t k = 1; k < n_labels; ++k)
                if (sent[k] > top) top = sent[k];
            double *forth = &message(along, 0);
            for (int64_t k = 0; k < n_labels; ++k) {
                const double before = forth[k];
                const double fresh = (1.0 - rule.damping) * (sent[k] - top) + rule.damping * before;
                const double change = std::fabs(fresh - before);
                if (change > largest) largest = change;
                forth[k] = fresh;
            }
        }
    }
    return largest;
}

// Fill `order` (N,) with every node after its parent and `parent` with the arcs to it.
//
// Returns -1, or the first edge that closes a cycle.
int64_t forest_order(Arcs arcs, Array<std::uint32_t, 1> order, Array<std::uint32_t, 1> parent,
                     Array<bool, 1> seen) {
    int64_t n_ordered = 0;
    for (int64_t root = 0; root < order.shape(0); ++root) {
        if (seen(root)) continue;
        seen(root) = true;
        parent(root) = NO_ARC;
        int64_t done = n_ordered;
        order(n_ordered++) = static_cast<std::uint32_t>(root);
        while (done < n_ordered) {
            const std::uint32_t i = order(done++);
            for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
                const Arc along = arcs.arc(slot);
                if (along == parent(i)) continue;
                const std::uint32_t j = arcs.head(slot);
                if (seen(j)) return along >> 1;
                seen(j) = true;
                parent(j) = along ^ REVERSE;
                order(n_ordered++) = j;
            }
        }
    }
    return -1;
}

// Fill `order` (N,) with the nodes, each beside one before it where the graph allows it.
void spanning_order(Arcs arcs, Array<std::uint32_t, 1> order, Array<bool, 1> seen) {
    int64_t n_ordered = 0;
    for (int64_t root = 0; root < order.shape(0); ++root) {
        if (seen(root)) continue;
        seen(root) = true;
        int64_t done = n_ordered;
        order(n_ordered++) = static_cast<std::uint32_t>(root);
        while (done < n_ordered) {
            const std::uint32_t i = order(done++);
            for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
                const std::uint32_t j = arcs.head(slot);
                if (seen(j)) continue;
                seen(j) = true;
                order(n_ordered++) = j;
            }
        }
    }
}

// The first of the largest numbers; the first that is not a number if there is one.
std::int32_t place_of_largest(const Numbers &numbers) {
    std::size_t best = 0;
    for (std::size_t k = 0; k < numbers.size(); ++k) {
        if (std::isnan(numbers[k])) return static_cast<std::int32_t>(k);
        if (numbers[k] > numbers[best]) best = k;
    }
    return static_cast<std::int32_t>(best);
}

// Label the nodes in order, each given the labels before it and the messages of the others.
//
// Only labels whose log-belief is within `slack` of the node's best are considered.
template <int N>
void decode_beliefs(Terms<N> terms, Arcs arcs, Order order, ConstMatrix message, double slack,
                    Array<std::int32_t, 1> labels) {
    const int64_t n_labels = terms.unary.shape(1);
    Numbers belief(n_labels), given(n_labels);
    std::fill(labels.begin(), labels.end(), -1);
    for (const std::uint32_t i : order) {
        gather_beliefs(terms.unary, arcs, message, i, belief);
        for (int64_t k = 0; k < n_labels; ++k) given[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const std::int32_t theirs = labels(arcs.head(slot));
            if (theirs >= 0) {
                add_edge(terms.pairwise, arcs.arc(slot), theirs, given.data(), n_labels);
                continue;
            }
            const double *incoming = &message(arcs.arc(slot) ^ REVERSE, 0);
            for (int64_t k = 0; k < n_labels; ++k) given[k] += incoming[k];
        }
        std::int32_t best = place_of_largest(belief);
        const double top = belief[best];
        for (std::int32_t k = 0; k < n_labels; ++k)
            if (belief[k] >= top - slack && given[k] > given[best]) best = k;
        labels(i) = best;
    }
}

// Messages from the leaves to the roots; for sums each node's share (N,) of log Z.
//
// `message` (2 E, K) starts at 0.
template <int N>
void pass_forest(bool maximise, Terms<N> terms, Arcs arcs, Order order, Order parent, Matrix message,
                 Row share) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    Numbers belief(n_labels), sent(n_labels);
    for (int64_t step = 0; step < n_nodes; ++step) {
        const std::uint32_t i = order(n_nodes - 1 - step);
        gather_beliefs(terms.unary, arcs, message, i, belief);
        if (parent(i) != NO_ARC) {
            share(i) = send(maximise, parent(i), belief, terms.pairwise, message, sent,
                            &message(parent(i), 0));
        } else if (!maximise) {
            const double top = belief[place_of_largest(belief)];
            share(i) = top;
            if (top > -INF) {
                double total = 0.0;
                for (const double value : belief) total += std::exp(value - top);
                share(i) += std::log(total);
            }
        }
    }
}

// Messages from the roots back to the leaves, after those of `pass_forest`.
template <int N>
void pass_back(bool maximise, Terms<N> terms, Arcs arcs, Order order, Order parent, Matrix message) {
    const int64_t n_labels = terms.unary.shape(1);
    Numbers belief(n_labels), sent(n_labels);
    for (const std::uint32_t i : order) {
        gather_beliefs(terms.unary, arcs, message, i, belief);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const Arc along = arcs.arc(slot);
            if (along != parent(i))
                send(maximise, along, belief, terms.pairwise, message, sent, &message(along, 0));
        }
    }
}

// The belief of a node given its parent's label, by what its children said.
template <int N>
void belief_below(std::uint32_t i, const Terms<N> &terms, const Arcs &arcs, const Order &parent,
                  const ConstMatrix &message, const Array<std::int32_t, 1> &labels, Numbers &belief) {
    gather_beliefs(terms.unary, arcs, message, i, belief);
    const Arc up = parent(i);
    if (up != NO_ARC)
        add_edge(terms.pairwise, up, labels(arcs.ends(up ^ REVERSE)), belief.data(),
                 static_cast<int64_t>(belief.size()));
}

// Label every node after its parent, by what its children said and the parent's label.
template <int N>
void decode_forest(Terms<N> terms, Arcs arcs, Order order, Order parent, ConstMatrix message,
                   Array<std::int32_t, 1> labels) {
    Numbers belief(terms.unary.shape(1));
    for (const std::uint32_t i : order) {
        belief_below(i, terms, arcs, parent, message, labels, belief);
        labels(i) = place_of_largest(belief);
    }
}

// Draw every node after its parent, by what its children said and the parent's label.
//
// `message` (2 E, K) are sums towards the roots, 0 elsewhere; `chance` (N,) in [0, 1).
template <int N>
void sample_forest(Terms<N> terms, Arcs arcs, Order order, Order parent, ConstMatrix message,
                   ConstRow chance, Array<std::int32_t, 1> labels) {
    Numbers belief(terms.unary.shape(1));
    for (const std::uint32_t i : order) {
        belief_below(i, terms, arcs, parent, message, labels, belief);
        const double top = belief[place_of_largest(belief)];
        double total = 0.0;
        for (double &value : belief) {
            value = std::exp(value - top);
            total += value;
        }
        double left = chance(i) * total;
        std::int32_t chosen = 0;
        for (std::int32_t k = 0; k < static_cast<std::int32_t>(belief.size()); ++k) {
            if (!(belief[k] > 0.0)) continue;
            chosen = k;
            left -= belief[k];
            if (left < 0.0) break;
        }
        labels(i) = chosen;
    }
}

template <int N> void add_all(Module &module) {
    module.add("message_sweep", message_sweep<N>, "upwards"_a, "rule"_a, "terms"_a, "arcs"_a,
               "message"_a);
    module.add("decode_beliefs", decode_beliefs<N>, "terms"_a, "arcs"_a, "order"_a, "message"_a,
               "slack"_a, "labels"_a);
    module.add("pass_forest", pass_forest<N>, "maximise"_a, "terms"_a, "arcs"_a, "order"_a,
               "parent"_a, "message"_a, "share"_a);
    module.add("pass_back", pass_back<N>, "maximise"_a, "terms"_a, "arcs"_a, "order"_a, "parent"_a,
               "message"_a);
    module.add("decode_forest", decode_forest<N>, "terms"_a, "arcs"_a, "order"_a, "parent"_a,
               "message"_a, "labels"_a);
    module.add("sample_forest", sample_forest<N>, "terms"_a, "arcs"_a, "order"_a, "parent"_a,
               "message"_a, "chance"_a, "labels"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("agreement_sweep", agreement_sweep, "upwards"_a, "rule"_a, "terms"_a, "gain"_a,
               "arcs"_a, "message"_a);
    module.add("forest_order", forest_order, "arcs"_a, "order"_a, "parent"_a, "seen"_a);
    module.add("spanning_order", spanning_order, "arcs"_a, "order"_a, "seen"_a);
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
