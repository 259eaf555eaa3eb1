// Kernels of beliefs where sets of nodes want one label: messages of sets, and expectations.
//
// What a set earns is a sum over labels of a worth that depends on how many of its nodes have that
// label. Under independent nodes such a number is a sum of independent zeros and ones, whose
// distribution takes O(n^2) steps for a set of n nodes.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;
using Numbers = std::vector<double>;
using Places = Array<const int64_t, 1>;

struct Sets {  // see SetTables in set_terms.py
    Places start, member;
    ConstMatrix worth, log_gain;
    auto fields() { return std::tie(start, member, worth, log_gain); }
};

// `log(exp(a) + exp(b))`.
double log_add(double a, double b) {
    const double high = a > b ? a : b, low = a > b ? b : a;
    return low == -INF ? high : high + std::log1p(std::exp(low - high));
}

double largest_of(const Numbers &numbers) { return *std::max_element(numbers.begin(), numbers.end()); }

// Room for one set of up to as many nodes, and K labels.
struct Room {
    Room(int64_t n_nodes, int64_t n_labels)
        : width(n_nodes + 1), later(width * width), before(width), yes(n_labels * n_nodes),
          no(n_labels * n_nodes), agreed(n_labels * n_nodes), differed(n_labels * n_nodes) {}
    int64_t width;
    Numbers later, before, yes, no, agreed, differed;  // the last four are a row per label
};

// The logarithm of a set's expected gain for one label, if each node has it and if it has not.
//
// `yes` and `no` (n,) are the logarithms of the probabilities that the others have it and that they
// have not. Written: `agreed` and `differed` (n,).
void without_each(int64_t n, const double *yes, const double *no, const double *log_gain, Room &room,
                  double *agreed, double *differed) {
    const auto later = [&](int64_t s, int64_t m) -> double & { return room.later[s * room.width + m]; };
    Numbers &before = room.before;
    for (int64_t m = 0; m <= n; ++m) later(n, m) = log_gain[m];
    for (int64_t s = n - 1; s > 0; --s)  // expected over node s and those after it, given m before
        for (int64_t m = 0; m <= s; ++m)
            later(s, m) = log_add(yes[s] + later(s + 1, m + 1), no[s] + later(s + 1, m));
    before[0] = 0.0;
    for (int64_t s = 0; s < n; ++s) {
        agreed[s] = differed[s] = -INF;
        for (int64_t m = 0; m <= s; ++m) {
            agreed[s] = log_add(agreed[s], before[m] + later(s + 1, m + 1));
            differed[s] = log_add(differed[s], before[m] + later(s + 1, m));
        }
        before[s + 1] = before[s] + yes[s];
        for (int64_t m = s; m > 0; --m) before[m] = log_add(before[m] + no[s], before[m - 1] + yes[s]);
        before[0] += no[s];
    }
}

// Logarithms of the probability of each label (K,) at node `s` of n, and of all others together.
void chances(const Numbers &log_belief, int64_t s, int64_t n, Room &room) {
    const int64_t n_labels = static_cast<int64_t>(log_belief.size());
    for (int64_t k = 0; k < n_labels; ++k) {
        double &no = room.no[k * n + s];
        no = -INF;
        for (int64_t other = 0; other < n_labels; ++other)
            if (other != k) no = log_add(no, log_belief[other]);
    }
    const double total = log_add(log_belief[0], room.no[s]);
    for (int64_t k = 0; k < n_labels; ++k) {
        room.yes[k * n + s] = log_belief[k] - total;
        room.no[k * n + s] -= total;
    }
}

// Renew the sum-product messages (M, K) of all sets to their members; the largest change.
//
// `heard` (N, K) is what each node hears from all, its unary included, `field` (N, K) its unary and
// what sets say; both follow the messages. Each message has 0 as its largest entry.
double pass_from_sets(Sets sets, Matrix heard, Matrix field, Matrix message) {
    const int64_t n_labels = heard.shape(1), n_sets = sets.start.shape(0) - 1;
    int64_t longest = 0;
    for (int64_t c = 0; c < n_sets; ++c) longest = std::max(longest, sets.start(c + 1) - sets.start(c));
    Room room(longest, n_labels);
    Numbers told(n_labels);
    double largest = 0.0;
    for (int64_t c = 0; c < n_sets; ++c) {
        const int64_t begin = sets.start(c), n = sets.start(c + 1) - sets.start(c);
        for (int64_t s = 0; s < n; ++s) {
            const int64_t i = sets.member(begin + s);
            for (int64_t k = 0; k < n_labels; ++k) {
                told[k] = heard(i, k);
                if (told[k] > -INF) told[k] -= message(begin + s, k);
            }
            // Every label may be ruled out, which is told when all is done.
            if (largest_of(told) == -INF) std::fill(told.begin(), told.end(), 0.0);
            chances(told, s, n, room);
        }
        for (int64_t k = 0; k < n_labels; ++k)
            without_each(n, &room.yes[k * n], &room.no[k * n], &sets.log_gain(k, begin + c), room,
                         &room.agreed[k * n], &room.differed[k * n]);
        for (int64_t s = 0; s < n; ++s) {
            const int64_t i = sets.member(begin + s);
            for (int64_t k = 0; k < n_labels; ++k) {
                told[k] = log_add(0.0, room.agreed[k * n + s]);
                for (int64_t other = 0; other < n_labels; ++other)
                    if (other != k) told[k] = log_add(told[k], room.differed[other * n + s]);
            }
            const double top = largest_of(told);
            for (int64_t k = 0; k < n_labels; ++k) {
                told[k] -= top;
                const double change = told[k] - message(begin + s, k);
                largest = std::max(largest, std::fabs(change));
                heard(i, k) += change;
                field(i, k) += change;
                message(begin + s, k) = told[k];
            }
        }
    }
    return largest;
}

// The distribution of how many of n nodes (n + 1,), of one more with probability `p`.
void put_in(double *count, int64_t n, double p) {
    count[n + 1] = count[n] * p;
    for (int64_t m = n; m > 0; --m) count[m] = count[m] * (1.0 - p) + count[m - 1] * p;
    count[0] *= 1.0 - p;
}

// The reverse, of n + 1 nodes, from the end at which rounding does not grow.
void take_out(double *count, int64_t n, double p) {
    if (p <= 0.5) {
        count[0] /= 1.0 - p;
        for (int64_t m = 1; m <= n; ++m)
            count[m] = std::max(count[m] - p * count[m - 1], 0.0) / (1.0 - p);
    } else {
        double rest = count[n + 1] / p;
        for (int64_t m = n; m > 0; --m) {
            const double fewer = std::max(count[m] - (1.0 - p) * rest, 0.0) / p;
            count[m] = rest;
            rest = fewer;
        }
        count[0] = rest;
    }
    count[n + 1] = 0.0;
}

// Update every node's beliefs in turn from its neighbours' and its sets'; the largest change.
//
// `q_i(k) ~ exp(unary[i, k] + sum_j sum_l q_j(l) pairwise(k, l) + sum_c E[worth of c | k])`. A node is
// the member `slots[slot_start[i] : slot_start[i + 1]]` of the sets `set_of` (M,).
template <int N>
double set_mean_field_pass(double damping, Terms<N> terms, Arcs arcs, Sets sets, Places set_of,
                           Places slot_start, Places slots, Matrix beliefs) {
    const int64_t n_nodes = terms.unary.shape(0), n_labels = terms.unary.shape(1);
    const int64_t width = sets.worth.shape(1);
    Numbers count(sets.worth.size()), value(n_labels);
    for (int64_t c = 0; c + 1 < sets.start.shape(0); ++c) {
        const int64_t begin = sets.start(c);
        for (int64_t k = 0; k < n_labels; ++k) {
            double *of_set = &count[k * width + begin + c];
            of_set[0] = 1.0;
            for (int64_t s = 0; s < sets.start(c + 1) - begin; ++s)
                put_in(of_set, s, beliefs(sets.member(begin + s), k));
        }
    }
    double largest = 0.0;
    for (int64_t i = 0; i < n_nodes; ++i) {
        for (int64_t k = 0; k < n_labels; ++k) value[k] = terms.unary(i, k);
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot)
            add_expected(terms.pairwise, arcs.arc(slot), &beliefs(arcs.head(slot), 0), value.data(),
                         n_labels);
        for (int64_t slot = slot_start(i); slot < slot_start(i + 1); ++slot) {
            const int64_t c = set_of(slots(slot));
            const int64_t first = sets.start(c) + c, others = sets.start(c + 1) - sets.start(c) - 1;
            for (int64_t k = 0; k < n_labels; ++k) {
                double *rest = &count[k * width + first];
                take_out(rest, others, beliefs(i, k));
                for (int64_t m = 0; m <= others; ++m)
                    value[k] +=
                        rest[m] * (sets.worth(k, first + m + 1) - sets.worth(k, first + m));
            }
        }
        const double top = largest_of(value);
        if (top > -INF) {  // else the neighbours forbid every label: the node keeps its beliefs
            double total = 0.0;
            for (int64_t k = 0; k < n_labels; ++k) {
                value[k] = std::exp(value[k] - top);
                total += value[k];
            }
            for (int64_t k = 0; k < n_labels; ++k) {
                const double fresh = (1.0 - damping) * value[k] / total + damping * beliefs(i, k);
                largest = std::max(largest, std::fabs(fresh - beliefs(i, k)));
                beliefs(i, k) = fresh;
            }
        }
        for (int64_t slot = slot_start(i); slot < slot_start(i + 1); ++slot) {
            const int64_t c = set_of(slots(slot));
            const int64_t first = sets.start(c) + c, others = sets.start(c + 1) - sets.start(c) - 1;
            for (int64_t k = 0; k < n_labels; ++k)
                put_in(&count[k * width + first], others, beliefs(i, k));
        }
    }
    return largest;
}

template <int N> void add_all(Module &module) {
    module.add("set_mean_field_pass", set_mean_field_pass<N>, "damping"_a, "terms"_a, "arcs"_a,
               "sets"_a, "set_of"_a, "slot_start"_a, "slots"_a, "beliefs"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("pass_from_sets", pass_from_sets, "sets"_a, "heard"_a, "field"_a, "message"_a);
    add_all<2>(module);
    add_all<3>(module);
}
