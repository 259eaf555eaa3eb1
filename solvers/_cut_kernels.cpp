// Kernels of the minimum cut: two search trees that grow, meet, push flow and adopt orphans.
//
// Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for energy
// minimization in vision" (PAMI 2004), with their time stamps and distances, on float64 capacities.
// An augmentation empties its narrowest arc to exactly 0.0, so the trees never hang on rounding.

#include "pgm_places/kernels/registry.hpp"
#include "solvers/_excess.hpp"

namespace {

using namespace pgm;
using Node = std::uint32_t;

constexpr std::int8_t FREE = 0, SOURCE = 1, SINK = 2;
// Marks above all arcs, in the place of the arc to a node's parent.
constexpr Arc NONE = 0xffffffff, ROOT = 0xfffffffe, ORPHAN = 0xfffffffd;
constexpr std::int64_t SUMMED_AT_ONCE = 4096;  // sums of sums round less than one long sum
constexpr std::uint32_t NEAR = 2;  // an orphan that finds a parent so near to the root looks no further

// The path of a node to its root, side by side as walks along it need them.
struct Path {
    Arc arc;              // to the parent, or one of the marks
    Node parent;
    std::uint32_t stamp;  // when the path was last known to be sound
    std::uint32_t depth;  // its length
};

struct Space {  // see CutSpace in graph_cut.py
    Array<std::int8_t, 1> side;
    Array<std::uint32_t, 2> path;
    Array<std::uint32_t, 1> active;
    Array<bool, 1> waiting;
    Array<std::uint32_t, 1> orphans;
    auto fields() { return std::tie(side, path, active, waiting, orphans); }
};

// A minimum cut at work.
class Trees {
  public:
    Trees(std::int64_t n_nodes, const Arcs &arcs, const Row &excess, const Row &capacity,
          const Space &space)
        : n_nodes_(n_nodes), n_ring_(space.active.shape(0)), start_(arcs.start.data()),
          head_(arcs.head.data()), arc_(arcs.arc.data()), excess_(excess.data()),
          capacity_(capacity.data()), side_(space.side.data()),
          path_(reinterpret_cast<Path *>(space.path.data())), active_(space.active.data()),
          waiting_(space.waiting.data()), orphans_(space.orphans.data()) {}

    void grow() {
        plant();
        bool going_on = false;
        Node i = 0;
        std::uint32_t slot = 0;
        while (true) {
            if (!going_on) {
                if (n_active_ == 0) return;
                i = active_[first_];
                first_ = first_ + 1 < n_ring_ ? first_ + 1 : 0;
                n_active_ -= 1;
                waiting_[i] = false;
                if (side_[i] == FREE) continue;
                slot = start_[i];
            }
            const std::int8_t grown = side_[i];
            const Arc against = grown == SINK ? REVERSE : FORTH;
            Arc bridge = NONE;
            Node beyond = 0;
            for (; slot < start_[i + 1]; ++slot) {
                const Node j = head_[slot];
                if (side_[j] == grown || !(capacity_[arc_[slot] ^ against] > 0.0)) continue;
                if (side_[j] != FREE) {
                    bridge = arc_[slot] ^ against;
                    beyond = j;
                    break;
                }
                side_[j] = grown;
                path_[j] = {arc_[slot] ^ REVERSE, i, path_[i].stamp, path_[i].depth + 1};
                if (!waiting_[j]) wake(j);
            }
            going_on = bridge != NONE;
            if (going_on) {
                clock_ += 1;
                if (grown == SOURCE) augment(bridge, i, beyond);
                else augment(bridge, beyond, i);
                adopt();
                // What it has passed is in its tree or cut off, and wakes it if it is set free.
                going_on = side_[i] == grown;
            }
        }
    }

  private:
    // Make a root of every node that is joined to a terminal, and find those that can grow.
    void plant() {
        for (std::int64_t i = 0; i < n_nodes_; ++i) {
            side_[i] = excess_[i] > 0.0 ? SOURCE : (excess_[i] < 0.0 ? SINK : FREE);
            path_[i].arc = side_[i] != FREE ? ROOT : NONE;
            path_[i].stamp = 0;
            path_[i].depth = 1;
        }
        for (std::int64_t i = 0; i < n_nodes_; ++i) {
            const Arc against = side_[i] == SINK ? REVERSE : FORTH;
            bool can_grow = false;
            for (std::uint32_t slot = start_[i]; slot < start_[i + 1]; ++slot) {
                // No branches: they could not be foreseen.
                const bool is_open = capacity_[arc_[slot] ^ against] > 0.0;
                can_grow |= is_open & (side_[head_[slot]] != side_[i]);
            }
            can_grow &= side_[i] != FREE;
            waiting_[i] = can_grow;
            active_[n_active_] = static_cast<Node>(i);
            n_active_ += can_grow;
        }
    }

    void wake(Node i) {
        waiting_[i] = true;
        const std::int64_t last = first_ + n_active_;
        active_[last < n_ring_ ? last : last - n_ring_] = i;
        n_active_ += 1;
    }

    void orphan(Node i) {
        path_[i].arc = ORPHAN;
        orphans_[n_orphans_++] = i;
    }

    // Push what fits through the arc `bridge` from `tail` at the source to `tip` at the sink.
    void augment(Arc bridge, Node tail, Node tip) {
        double push = capacity_[bridge];
        Node i = tail;
        for (; path_[i].arc != ROOT; i = path_[i].parent)
            push = std::min(push, capacity_[path_[i].arc ^ REVERSE]);
        push = std::min(push, excess_[i]);
        for (i = tip; path_[i].arc != ROOT; i = path_[i].parent)
            push = std::min(push, capacity_[path_[i].arc]);
        push = std::min(push, -excess_[i]);

        capacity_[bridge] -= push;
        capacity_[bridge ^ REVERSE] += push;
        n_orphans_ = 0;
        for (i = tail; path_[i].arc != ROOT;) {
            const Arc up = path_[i].arc;
            const Node parent = path_[i].parent;
            capacity_[up] += push;
            capacity_[up ^ REVERSE] -= push;
            if (capacity_[up ^ REVERSE] <= 0.0) orphan(i);
            i = parent;
        }
        excess_[i] -= push;
        if (excess_[i] <= 0.0) orphan(i);
        for (i = tip; path_[i].arc != ROOT;) {
            const Arc up = path_[i].arc;
            const Node parent = path_[i].parent;
            capacity_[up] -= push;
            capacity_[up ^ REVERSE] += push;
            if (capacity_[up] <= 0.0) orphan(i);
            i = parent;
        }
        excess_[i] += push;
        if (excess_[i] >= 0.0) orphan(i);
    }

    // Find every orphan a new parent in its tree or set it free.
    void adopt() {
        std::reverse(orphans_, orphans_ + n_orphans_);  // nearest to the roots first
        std::int64_t done = 0;
        while (n_orphans_ > 0) {
            const Node i = orphans_[done];
            done = done + 1 < n_ring_ ? done + 1 : 0;
            n_orphans_ -= 1;
            const std::int8_t tree = side_[i];
            // Residuals count towards a node of the source's tree and away from one of the sink's.
            const Arc against = tree == SOURCE ? REVERSE : FORTH;
            if (find_parent(i, tree, against)) continue;
            path_[i].arc = NONE;
            side_[i] = FREE;
            for (std::uint32_t slot = start_[i]; slot < start_[i + 1]; ++slot) {
                const Node j = head_[slot];
                if (side_[j] != tree) continue;
                if (capacity_[arc_[slot] ^ against] > 0.0 && !waiting_[j]) wake(j);
                if (path_[j].arc == (arc_[slot] ^ REVERSE)) {
                    path_[j].arc = ORPHAN;
                    const std::int64_t last = done + n_orphans_;
                    orphans_[last < n_ring_ ? last : last - n_ring_] = j;
                    n_orphans_ += 1;
                }
            }
        }
    }

    bool find_parent(Node i, std::int8_t tree, Arc against) {
        Arc best = NONE;
        Node parent = 0;
        std::uint32_t best_depth = NONE;
        for (std::uint32_t slot = start_[i]; slot < start_[i + 1]; ++slot) {
            const Node j = head_[slot];
            if (side_[j] != tree || !(capacity_[arc_[slot] ^ against] > 0.0)) continue;
            // It may have come nearer since, but that is too rare to be looked up.
            if (path_[j].depth >= best_depth) continue;
            const std::uint32_t distance = depth_if_rooted(j);
            if (0 < distance && distance < best_depth) {
                best_depth = distance;
                best = arc_[slot];
                parent = j;
                if (distance <= NEAR) break;
            }
        }
        if (best == NONE) return false;
        path_[i] = {best, parent, clock_, best_depth + 1};
        return true;
    }

    // How far `i` is from its root, 0 if its path ends at an orphan; marks a sound path.
    std::uint32_t depth_if_rooted(Node i) {
        std::uint32_t distance = 0;
        Node j = i;
        bool is_known = true;
        while (path_[j].stamp != clock_) {
            const Arc up = path_[j].arc;
            distance += 1;
            if (up == ROOT) {
                path_[j].stamp = clock_;
                path_[j].depth = 1;
                is_known = false;
                break;
            }
            if (up >= ORPHAN) return 0;
            j = path_[j].parent;
        }
        if (is_known) distance += path_[j].depth;
        const std::uint32_t found = distance;
        for (j = i; path_[j].stamp != clock_; j = path_[j].parent) {
            path_[j].stamp = clock_;
            path_[j].depth = distance--;
        }
        return found;
    }

    std::int64_t n_nodes_, n_ring_, first_ = 0, n_active_ = 0, n_orphans_ = 0;
    std::uint32_t clock_ = 0;
    const std::uint32_t *start_, *head_, *arc_;
    double *excess_, *capacity_;
    std::int8_t *side_;
    Path *path_;
    std::uint32_t *active_;
    bool *waiting_;
    std::uint32_t *orphans_;
};

// Leave in `space.side` who can be reached from the source, who reaches the sink, and FREE.
//
// The first `n_nodes` nodes take part. `excess` is the capacity from the source less that to the sink,
// `capacity` is per arc; both end as residuals. Arrays may be longer than needed; the arcs' `ends` are
// not looked at.
void minimum_cut_kernel(std::int64_t n_nodes, Arcs arcs, Row excess, Row capacity, Space space) {
    spread_excess(n_nodes, arcs, excess, capacity);
    push_between_neighbours(n_nodes, arcs, excess, capacity);
    Trees(n_nodes, arcs, excess, capacity, space).grow();
}

// The sum of the capacities (E,) that lead from nodes inside to nodes that are not.
double parted_capacity(Array<const std::int32_t, 2> edges, Array<const bool, 1> inside,
                       ConstRow forward, ConstRow backward) {
    double total = 0.0;
    for (std::int64_t block = 0; block < edges.shape(0); block += SUMMED_AT_ONCE) {
        double part = 0.0;
        const std::int64_t end = std::min(block + SUMMED_AT_ONCE, edges.shape(0));
        for (std::int64_t e = block; e < end; ++e) {
            const bool first = inside(edges(e, 0)), second = inside(edges(e, 1));
            if (first != second) part += first ? forward(e) : backward(e);
        }
        total += part;
    }
    return total;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("spread_excess", spread_excess, "n_nodes"_a, "arcs"_a, "excess"_a, "capacity"_a);
    module.add("minimum_cut_kernel", minimum_cut_kernel, "n_nodes"_a, "arcs"_a, "excess"_a,
               "capacity"_a, "space"_a);
    module.add("parted_capacity", parted_capacity, "edges"_a, "inside"_a, "forward"_a, "backward"_a);
}
