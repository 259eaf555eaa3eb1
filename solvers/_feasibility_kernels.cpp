// Kernel of the search for a labelling that breaks no rule: propagate, decide, take back.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_pairwise.hpp"

namespace {

using namespace pgm;
using std::int64_t;

constexpr int64_t FOUND = 1, GIVEN_UP = 0, NONE_EXISTS = -1;  // see local_search.py

struct Space {  // see _SearchSpace in local_search.py
    Array<bool, 2> alive;
    Array<std::int32_t, 1> n_alive;
    Array<int64_t, 1> trail;
    Array<int64_t, 2> decided;
    Array<std::uint32_t, 1> ring;
    Array<bool, 1> waiting;
    Array<int64_t, 1> counts;
    auto fields() { return std::tie(alive, n_alive, trail, decided, ring, waiting, counts); }
};

template <int N> class Search {
  public:
    Search(const Terms<N> &terms, const Arcs &arcs, const Space &space)
        : terms_(terms), arcs_(arcs), space_(space), n_nodes_(terms.unary.shape(0)),
          n_labels_(terms.unary.shape(1)), n_trail_(space.counts(0)), n_ring_(space.counts(1)),
          first_(space.counts(2)) {}

    // Nodes are decided in index order. After each decision the labels that no neighbour supports any
    // more are ruled out (arc consistency), so that on a forest nothing is ever taken back.
    int64_t find(const Array<const std::int32_t, 1> &wanted, int64_t max_failures) {
        auto &[alive, n_alive, trail, decided, ring, waiting, counts] = space_;
        n_trail_ = n_ring_ = first_ = 0;
        for (int64_t i = 0; i < n_nodes_; ++i) {
            n_alive(i) = 0;
            waiting(i) = false;
            for (int64_t k = 0; k < n_labels_; ++k) {
                alive(i, k) = terms_.unary(i, k) > -INF;
                n_alive(i) += alive(i, k);
            }
        }
        for (int64_t i = 0; i < n_nodes_; ++i) look_around(i);
        if (!propagate()) return NONE_EXISTS;
        int64_t node = 0, n_decided = 0, n_failures = 0;
        while (true) {
            while (node < n_nodes_ && n_alive(node) == 1) node += 1;
            if (node == n_nodes_) return FOUND;
            int64_t label = wanted(node);
            if (!alive(node, label)) label = best_alive(node);
            decided(n_decided, 0) = node;
            decided(n_decided, 1) = label;
            decided(n_decided, 2) = n_trail_;
            n_decided += 1;
            for (int64_t k = 0; k < n_labels_; ++k)
                if (k != label && alive(node, k)) rule_out(node, k);
            look_around(node);
            while (!propagate()) {
                n_failures += 1;
                if (n_failures > max_failures) return GIVEN_UP;
                if (n_decided == 0) return NONE_EXISTS;
                n_decided -= 1;
                node = decided(n_decided, 0);
                while (n_trail_ > decided(n_decided, 2)) {
                    n_trail_ -= 1;
                    const int64_t i = trail(n_trail_) / n_labels_, k = trail(n_trail_) % n_labels_;
                    alive(i, k) = true;
                    n_alive(i) += 1;
                }
                rule_out(node, decided(n_decided, 1));
                look_around(node);
            }
        }
    }

  private:
    void rule_out(int64_t i, int64_t k) {
        space_.alive(i, k) = false;
        space_.n_alive(i) -= 1;
        space_.trail(n_trail_++) = i * n_labels_ + k;
    }

    // Have the neighbours of `i` looked at when labels are propagated next.
    void look_around(int64_t i) {
        if (space_.waiting(i)) return;
        space_.waiting(i) = true;
        const int64_t last = first_ + n_ring_, size = space_.ring.shape(0);
        space_.ring(last < size ? last : last - size) = static_cast<std::uint32_t>(i);
        n_ring_ += 1;
    }

    // Rule out what no neighbour supports, until nothing changes; false if a node has none left.
    bool propagate() {
        bool possible = true;
        while (n_ring_ > 0) {
            const int64_t j = space_.ring(first_);
            first_ = first_ + 1 < space_.ring.shape(0) ? first_ + 1 : 0;
            n_ring_ -= 1;
            space_.waiting(j) = false;
            if (!possible) continue;  // only the ring is emptied
            for (int64_t slot = arcs_.start(j); slot < arcs_.start(j + 1); ++slot) {
                const int64_t i = arcs_.head(slot);
                bool changed = false;
                for (int64_t k = 0; k < n_labels_; ++k) {
                    if (!space_.alive(i, k) || is_supported(j, arcs_.arc(slot), k)) continue;
                    rule_out(i, k);
                    changed = true;
                }
                possible = possible && space_.n_alive(i) > 0;
                if (changed && possible) look_around(i);
            }
        }
        return possible;
    }

    // Whether a label of `j` allows label `k` at the arc's head.
    bool is_supported(int64_t j, Arc arc, int64_t k) const {
        for (int64_t other = 0; other < n_labels_; ++other)
            if (space_.alive(j, other) && edge_score(terms_.pairwise, arc, other, k) > -INF)
                return true;
        return false;
    }

    // The label with the largest potential beside the neighbours that have one label left.
    int64_t best_alive(int64_t i) const {
        int64_t best = -1;
        double best_value = -INF;
        for (int64_t k = 0; k < n_labels_; ++k) {
            if (!space_.alive(i, k)) continue;
            double value = terms_.unary(i, k);
            for (int64_t slot = arcs_.start(i); slot < arcs_.start(i + 1); ++slot) {
                const int64_t j = arcs_.head(slot);
                if (space_.n_alive(j) != 1) continue;
                int64_t only = 0;
                while (!space_.alive(j, only)) ++only;
                value += edge_score(terms_.pairwise, arcs_.arc(slot), k, only);
            }
            if (best < 0 || value > best_value) {
                best = k;
                best_value = value;
            }
        }
        return best;
    }

    Terms<N> terms_;
    Arcs arcs_;
    Space space_;
    int64_t n_nodes_, n_labels_;
    int64_t &n_trail_, &n_ring_, &first_;
};

// Search for a labelling without -inf, near `wanted` (N,); FOUND, GIVEN_UP or NONE_EXISTS.
template <int N>
int64_t find_allowed(Terms<N> terms, Arcs arcs, Array<const std::int32_t, 1> wanted,
                     int64_t max_failures, Space space) {
    return Search<N>(terms, arcs, space).find(wanted, max_failures);
}

template <int N> void add_all(Module &module) {
    module.add("find_allowed", find_allowed<N>, "terms"_a, "arcs"_a, "wanted"_a, "max_failures"_a,
               "space"_a);
}

}  // namespace

PGM_KERNELS(module) {
    add_all<2>(module);
    add_all<3>(module);
    add_all<1>(module);
}
