// Kernels of the expansion move: who may switch, what switching earns, and what it earned.
//
// A move on label `a` lets every node keep its label or switch to `a`. Over the nodes that switch the
// score changes by `sum_i low_i + sum_ij w_ij [both switch]` with `w >= 0`: `low_i` is what `i` earns
// when no undecided neighbour switches, `high_i = low_i + sum_j w_ij` when all do. A node with
// `high <= 0` keeps and one with `low > 0` switches whatever the others do; only the rest is left to
// the minimum cut.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;
using Nodes = Array<std::uint32_t, 1>;
using Labels = Array<const std::int32_t, 1>;

constexpr double ROUNDING = 1e-12;  // a gain below this share of its terms is rounding

struct Move {  // see graph_cut.py
    Nodes members;
    Array<bool, 1> undecided;
    Row low, high, weight;
    auto fields() { return std::tie(members, undecided, low, high, weight); }
};

struct CutArcs {
    Array<std::uint32_t, 1> start, head, arc, ends;
    auto fields() { return std::tie(start, head, arc, ends); }
};

struct Cut {  // see graph_cut.py
    Nodes number, edge_number;
    CutArcs arcs;
    Row excess, capacity;
    auto fields() { return std::tie(number, edge_number, arcs, excess, capacity); }
};

// Add up in `reach` (N, K) what each node could earn from its edges by each label.
void agreement_reach(Array<const std::uint32_t, 1> ends, ConstMatrix agreement, Matrix reach) {
    for (int64_t e = 0; e < agreement.shape(0); ++e) {
        const int64_t i = ends(2 * e), j = ends(2 * e + 1);
        for (int64_t k = 0; k < agreement.shape(1); ++k) {
            reach(i, k) += agreement(e, k);
            reach(j, k) += agreement(e, k);
        }
    }
}

// What an edge earns a node that switches: if its head stays, and if it switches too.
struct Switching {
    double settled, joint, weight;
};

template <int N>
Switching when_switching(const Array<const double, N> &pairwise, Arc arc, int64_t mine, int64_t theirs,
                         int64_t label) {
    if constexpr (N == 2) {
        // No branches: which case a neighbour is cannot be foreseen by the processor.
        const double earned = pairwise(arc >> 1, label), of_mine = pairwise(arc >> 1, mine);
        const double kept = theirs == mine ? of_mine : 0.0;
        return {theirs == label ? earned : -kept, earned, kept + earned};
    } else {
        const double both_keep = edge_score(pairwise, arc, mine, theirs);
        const double only_owner = edge_score(pairwise, arc, label, theirs);
        const double only_head = edge_score(pairwise, arc, mine, label);
        const double both = edge_score(pairwise, arc, label, label);
        const double weight = std::max((both_keep + both) - (only_owner + only_head), 0.0);
        return {only_owner - both_keep, only_owner - both_keep + weight, weight};
    }
}

// Set up the move; how many members there are.
//
// `reach` (N, K) bounds what a node earns from its edges by each label.
template <int N>
int64_t begin_move(int64_t label, Labels labels, Terms<N> terms, ConstMatrix reach, Arcs arcs,
                   Move move) {
    const auto &unary = terms.unary;
    int64_t n_members = 0;
    for (int64_t i = 0; i < labels.shape(0); ++i) {
        const double switching = unary(i, label) - unary(i, labels(i)) + reach(i, label);
        const bool may = (labels(i) != label) & (switching > 0.0);
        move.undecided(i) = may;
        move.members(n_members) = static_cast<std::uint32_t>(i);
        n_members += may;
    }
    for (int64_t m = 0; m < n_members; ++m) {
        const int64_t i = move.members(m);
        double least = unary(i, label) - unary(i, labels(i)), most = least;
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const int64_t j = arcs.head(slot);
            const Switching earned =
                when_switching(terms.pairwise, arcs.arc(slot), labels(i), labels(j), label);
            move.weight(arcs.arc(slot) >> 1) = earned.weight;
            least += earned.settled;
            most += move.undecided(j) ? earned.joint : earned.settled;
        }
        move.low(i) = least;
        move.high(i) = most;
    }
    return n_members;
}

// Decide members whose choice no neighbour can change, and what follows from them.
//
// Those that switch are written to `switched`; how many they are is returned.
int64_t peel_move(int64_t n_members, Arcs arcs, Move move, Nodes stack, Nodes switched) {
    auto &[members, undecided, low, high, weight] = move;
    int64_t n_stack = 0, n_switched = 0;
    for (int64_t m = 0; m < n_members; ++m) {
        const std::uint32_t i = members(m);
        if (high(i) <= 0.0 || low(i) > 0.0) {
            undecided(i) = false;
            stack(n_stack++) = i;
        }
    }
    while (n_stack > 0) {
        const std::uint32_t i = stack(--n_stack);
        const bool switches = low(i) > 0.0;
        if (switches) switched(n_switched++) = i;
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const std::uint32_t j = arcs.head(slot);
            if (!undecided(j)) continue;  // decided already, even if it still waits in the stack
            if (switches) low(j) += weight(arcs.arc(slot) >> 1);
            else high(j) -= weight(arcs.arc(slot) >> 1);
            if (high(j) <= 0.0 || low(j) > 0.0) {
                undecided(j) = false;
                stack(n_stack++) = j;
            }
        }
    }
    return n_switched;
}

// Lay out the cut's graph of the members still undecided; how many they are.
//
// They are moved to the front of `move.members`.
int64_t extract_cut(int64_t n_members, Arcs arcs, Move move, Cut cut) {
    auto &[members, undecided, low, high, weight] = move;
    int64_t n_left = 0;
    for (int64_t m = 0; m < n_members; ++m) {
        const std::uint32_t i = members(m);
        members(n_left) = i;
        cut.number(i) = static_cast<std::uint32_t>(n_left);
        cut.excess(n_left) = -0.5 * (low(i) + high(i));
        n_left += undecided(i);
    }
    std::uint32_t n_slots = 0, n_edges = 0;
    for (int64_t m = 0; m < n_left; ++m) {
        const std::uint32_t i = members(m);
        cut.arcs.start(m) = n_slots;
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const std::uint32_t j = arcs.head(slot);
            if (!undecided(j)) continue;
            const Arc edge = arcs.arc(slot) >> 1, side = arcs.arc(slot) & 1;
            if (j > i) {
                cut.edge_number(edge) = n_edges;
                cut.capacity(2 * n_edges) = 0.5 * weight(edge);
                cut.capacity(2 * n_edges + 1) = 0.5 * weight(edge);
                n_edges += 1;
            }
            cut.arcs.head(n_slots) = cut.number(j);
            cut.arcs.arc(n_slots) = 2 * cut.edge_number(edge) + side;
            n_slots += 1;
        }
    }
    cut.arcs.start(n_left) = n_slots;
    return n_left;
}

// What switching earns, 0.0 where it is only rounding; `fresh` (N,) becomes the labels.
template <int N>
double gain_of(int64_t label, Array<const std::uint32_t, 1> switched, Labels labels, Terms<N> terms,
               Arcs arcs, Array<std::int32_t, 1> fresh) {
    const auto &[unary, pairwise] = terms;
    for (const std::uint32_t i : switched) fresh(i) = static_cast<std::int32_t>(label);
    double gain = 0.0, size = 0.0;
    for (const std::uint32_t i : switched) {
        gain += unary(i, label) - unary(i, labels(i));
        size += std::fabs(unary(i, label)) + std::fabs(unary(i, labels(i)));
        for (int64_t slot = arcs.start(i); slot < arcs.start(i + 1); ++slot) {
            const std::uint32_t j = arcs.head(slot);
            if (fresh(j) != labels(j) && j < i) continue;  // the edge is counted at its other end
            const double after = edge_score(pairwise, arcs.arc(slot), label, fresh(j));
            const double before = edge_score(pairwise, arcs.arc(slot), labels(i), labels(j));
            gain += after;
            size += std::fabs(after);
            gain -= before;
            size += std::fabs(before);
        }
    }
    return gain > ROUNDING * size ? gain : 0.0;
}

template <int N> void add_all(Module &module) {
    module.add("begin_move", begin_move<N>, "label"_a, "labels"_a, "terms"_a, "reach"_a, "arcs"_a,
               "move"_a);
    module.add("gain_of", gain_of<N>, "label"_a, "switched"_a, "labels"_a, "terms"_a, "arcs"_a,
               "fresh"_a);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("agreement_reach", agreement_reach, "ends"_a, "agreement"_a, "reach"_a);
    module.add("peel_move", peel_move, "n_members"_a, "arcs"_a, "move"_a, "stack"_a, "switched"_a);
    module.add("extract_cut", extract_cut, "n_members"_a, "arcs"_a, "move"_a, "cut"_a);
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
