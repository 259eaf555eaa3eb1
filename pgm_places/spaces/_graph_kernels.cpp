// The position of a node in a graph: shortest paths through it, connectivity without it.
//
// The neighbours of node i are `neighbour[start[i]]` to `neighbour[start[i + 1]]`.

#include <algorithm>
#include <span>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

struct Graph {
    Array<const int32_t, 1> start, neighbour;

    int64_t size() const { return start.size() - 1; }
    std::span<const int32_t> around(int64_t i) const {
        return {neighbour.data() + start(i), neighbour.data() + start(i + 1)};
    }
};

// Write the number of each node's component (N,), in the order of their first nodes.
void number_components(Array<const int32_t, 1> start, Array<const int32_t, 1> neighbour,
                       Array<int32_t, 1> component) {
    const Graph graph = {start, neighbour};
    std::vector<int32_t> waiting;
    int32_t count = 0;
    std::fill(component.begin(), component.end(), -1);
    for (int32_t first = 0; first < graph.size(); ++first) {
        if (component(first) >= 0) continue;
        component(first) = count;
        waiting.push_back(first);
        while (!waiting.empty()) {
            const int32_t i = waiting.back();
            waiting.pop_back();
            for (const int32_t j : graph.around(i)) {
                if (component(j) >= 0) continue;
                component(j) = count;
                waiting.push_back(j);
            }
        }
        ++count;
    }
}

// Shares of the shortest paths from one node that pass through the others (Brandes, 2001).
class Paths {
  public:
    explicit Paths(const Graph &graph)
        : graph_(graph), distance_(graph.size(), -1), paths_(graph.size()), passed_(graph.size()) {}

    // Add to `share` (N,); returns the number of nodes reached, including the source.
    int64_t add_from(int32_t source, const Array<double, 1> &share) {
        order_.assign(1, source);
        distance_[source] = 0;
        paths_[source] = 1.0;
        for (std::size_t at = 0; at < order_.size(); ++at) {
            const int32_t i = order_[at];
            for (const int32_t j : graph_.around(i)) {
                if (distance_[j] < 0) {
                    distance_[j] = distance_[i] + 1;
                    paths_[j] = passed_[j] = 0.0;
                    order_.push_back(j);
                }
                if (distance_[j] == distance_[i] + 1) paths_[j] += paths_[i];
            }
        }
        for (std::size_t at = order_.size() - 1; at > 0; --at) {
            const int32_t j = order_[at];
            for (const int32_t i : graph_.around(j))
                if (distance_[i] == distance_[j] - 1)
                    passed_[i] += paths_[i] / paths_[j] * (1.0 + passed_[j]);
            share(j) += passed_[j];
        }
        for (const int32_t i : order_) distance_[i] = -1;
        return static_cast<int64_t>(order_.size());
    }

  private:
    Graph graph_;
    std::vector<int32_t> order_, distance_;
    std::vector<double> paths_, passed_;
};

// Write the share of shortest paths from some sources that pass through each node.
//
// Paths start at the first `most` of the `sources` in every component. `share` (N,) is 0 on entry.
void add_paths(Array<const int64_t, 1> sources, Array<const int32_t, 1> component, int64_t most,
               Array<const int32_t, 1> start, Array<const int32_t, 1> neighbour,
               Array<double, 1> share) {
    Paths paths({start, neighbour});
    std::vector<int64_t> taken(share.size()), reached(share.size());  // by component
    std::vector<char> is_source(share.size());
    for (const int64_t source : sources) {
        const int32_t home = component(source);
        if (taken[home] == most) continue;
        taken[home] += 1;
        is_source[source] = true;
        reached[home] = paths.add_from(static_cast<int32_t>(source), share);
    }
    for (int64_t i = 0; i < share.size(); ++i) {  // those from the node itself are not through it
        const int32_t home = component(i);
        const int64_t pairs = (taken[home] - is_source[i]) * (reached[home] - 2);
        share(i) = pairs > 0 ? share(i) / static_cast<double>(pairs) : 0.0;
    }
}

// A node of a depth-first search.
struct Visit {
    int64_t seen = -1, lowest = -1, parent = -1;  // in the order of discovery
    int32_t edge = 0;                             // the next one to follow
    double below, largest = 0.0, cut = 0.0;  // of its subtree; of the subtrees cut off, and in all
};

// Write the weight of each node's component, and of its largest part without the node.
//
// Depth-first search (Hopcroft and Tarjan, 1973): a child's subtree is cut off if no edge leads from it
// to an ancestor of the node.
void largest_rests(Array<const int32_t, 1> start, Array<const int32_t, 1> neighbour,
                   Array<const double, 1> weight, Array<double, 1> rest, Array<double, 1> whole) {
    std::vector<Visit> visits(weight.size());
    for (int64_t i = 0; i < weight.size(); ++i) {
        visits[i].edge = start(i);
        visits[i].below = weight(i);
    }
    std::vector<int64_t> stack, found;
    for (int64_t root = 0; root < weight.size(); ++root) {
        if (visits[root].seen >= 0) continue;
        const std::size_t first = found.size();
        stack.push_back(root);
        while (!stack.empty()) {
            const int64_t i = stack.back();
            Visit &own = visits[i];
            if (own.seen < 0) {
                own.seen = own.lowest = static_cast<int64_t>(found.size());
                found.push_back(i);
            }
            if (own.edge < start(i + 1)) {
                const int64_t j = neighbour(own.edge++);
                if (visits[j].seen < 0) {
                    visits[j].parent = i;
                    stack.push_back(j);
                } else if (j != own.parent) {
                    own.lowest = std::min(own.lowest, visits[j].seen);
                }
                continue;
            }
            stack.pop_back();
            if (own.parent < 0) continue;
            Visit &parent = visits[own.parent];
            parent.lowest = std::min(parent.lowest, own.lowest);
            parent.below += own.below;
            if (own.lowest < parent.seen) continue;
            parent.cut += own.below;
            parent.largest = std::max(parent.largest, own.below);
        }
        const double all = visits[root].below;
        for (std::size_t at = first; at < found.size(); ++at) {
            const int64_t i = found[at];
            whole(i) = all;
            rest(i) = std::max(visits[i].largest, all - weight(i) - visits[i].cut);
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("number_components", number_components, "start"_a, "neighbour"_a, "component"_a);
    module.add("add_paths", add_paths, "sources"_a, "component"_a, "most"_a, "start"_a,
               "neighbour"_a, "share"_a);
    module.add("largest_rests", largest_rests, "start"_a, "neighbour"_a, "weight"_a, "rest"_a,
               "whole"_a);
}
