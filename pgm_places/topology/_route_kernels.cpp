// Straight edges over the cells of a raster: their clearance, their regions, which are needed.
//
// Positions are rows and columns in cells, integers being cell centres. A blocked cell is a square.

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <queue>
#include <utility>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// The part of a segment that is between some lines, as shares of its way.
struct Part {
    double from = 0.0, to = 1.0;

    // Cut it to where the coordinate that goes from `start` to `end` is between `low` and `high`.
    void cut(double start, double end, double low, double high) {
        if (start == end) {
            if (start < low || start > high) to = -1.0;
            return;
        }
        const double a = (low - start) / (end - start), b = (high - start) / (end - start);
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
    }
};

// Distance from a segment to the square of side 1 around the origin.
double distance_to_square(double y0, double x0, double y1, double x1) {
    Part within;
    within.cut(y0, y1, -0.5, 0.5);
    within.cut(x0, x1, -0.5, 0.5);
    if (within.from <= within.to) return 0.0;
    // Of two convex shapes that do not meet, a corner of one is nearest to the other.
    const auto from_end = [](double y, double x) {
        return std::hypot(std::max(std::abs(y) - 0.5, 0.0), std::max(std::abs(x) - 0.5, 0.0));
    };
    double best = std::min(from_end(y0, x0), from_end(y1, x1));
    const double dy = y1 - y0, dx = x1 - x0, squared = dy * dy + dx * dx;
    for (const double y : {-0.5, 0.5})
        for (const double x : {-0.5, 0.5}) {
            double t = 0.0;
            if (squared > 0.0)
                t = std::min(std::max(((y - y0) * dy + (x - x0) * dx) / squared, 0.0), 1.0);
            best = std::min(best, std::hypot(y0 + t * dy - y, x0 + t * dx - x));
        }
    return best;
}

// The exact distance from each segment to the nearest blocked square, at most `most`.
//
// `ends` (M, 4) are the rows and columns of both ends, inside a raster (H, W) whose edge is blocked;
// `most` (M,) and `clearance` (M,) are in cells.
void segment_clearances(Array<const bool, 2> blocked, Array<const double, 2> ends,
                        Array<const double, 1> most, Array<double, 1> clearance) {
    // The cells whose squares are at most `best` from coordinates between a and b.
    const auto first = [](double a, double b, double best) {
        return std::max<int64_t>(std::ceil(std::min(a, b) - best - 0.5), 0);
    };
    const auto last = [](double a, double b, double best, int64_t length) {
        return std::min<int64_t>(std::floor(std::max(a, b) + best + 0.5), length - 1);
    };
    for (int64_t m = 0; m < ends.shape(0); ++m) {
        const double y0 = ends(m, 0), x0 = ends(m, 1), y1 = ends(m, 2), x1 = ends(m, 3);
        double best = most(m);
        const int64_t bottom = last(y0, y1, best, blocked.shape(0));
        for (int64_t r = first(y0, y1, best); r <= bottom; ++r) {
            Part near_row;
            if (y0 != y1) near_row.cut(y0, y1, r - best - 0.5, r + best + 0.5);
            if (near_row.from > near_row.to) continue;
            const double xa = x0 + near_row.from * (x1 - x0), xb = x0 + near_row.to * (x1 - x0);
            const int64_t right = last(xa, xb, best, blocked.shape(1));
            for (int64_t c = first(xa, xb, best); c <= right; ++c)
                if (blocked(r, c))
                    best = std::min(best, distance_to_square(y0 - r, x0 - c, y1 - r, x1 - c));
        }
        clearance(m) = best;
    }
}

// Which segments (M, 4) cross only cells of the two regions that they begin and end in.
void stays_between(Array<const int32_t, 2> region, Array<const double, 2> ends,
                   Array<bool, 1> stays) {
    // No coordinate in the raster is below -0.5: what is cut off rounds down.
    const auto region_at = [&](double y, double x) { return region(y + 0.5, x + 0.5); };
    for (int64_t m = 0; m < ends.shape(0); ++m) {
        const double y0 = ends(m, 0), x0 = ends(m, 1), y1 = ends(m, 2), x1 = ends(m, 3);
        const int32_t first = region_at(y0, x0), last = region_at(y1, x1);
        const double length = std::max(std::abs(y1 - y0), std::abs(x1 - x0));
        const int64_t n_steps = static_cast<int64_t>(4 * length) + 1;
        stays(m) = true;
        for (int64_t step = 0; step <= n_steps && stays(m); ++step) {
            const double t = static_cast<double>(step) / static_cast<double>(n_steps);
            const int32_t here = region_at(y0 + t * (y1 - y0), x0 + t * (x1 - x0));
            stays(m) = here == first || here == last;
        }
    }
}

// Twice the signed area of a triangle: positive where it turns to the left.
int64_t turn(const int64_t *a, const int64_t *b, const int64_t *c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// Whether a point is on the segment from `a` to `b`, its ends included.
bool is_on(const int64_t *a, const int64_t *b, const int64_t *c) {
    return turn(a, b, c) == 0 && std::min(a[0], b[0]) <= c[0] && c[0] <= std::max(a[0], b[0]) &&
           std::min(a[1], b[1]) <= c[1] && c[1] <= std::max(a[1], b[1]);
}

// Whether the segments from `a` to `b` and from `c` to `d` cross at inner points of both.
bool cross(const int64_t *a, const int64_t *b, const int64_t *c, const int64_t *d) {
    const auto apart = [](int64_t one, int64_t other) {
        return (one < 0 && other > 0) || (one > 0 && other < 0);
    };
    return apart(turn(a, b, c), turn(a, b, d)) && apart(turn(c, d, a), turn(c, d, b));
}

// Numbers by squares as large as the longest edge: whatever meets an edge is in an adjacent square.
class Squares {
  public:
    explicit Squares(int64_t side) : side_(side) {}

    void add(int64_t y, int64_t x, int64_t number) { in_[{y / side_, x / side_}].push_back(number); }

    template <class Test> bool any(int64_t y, int64_t x, Test test) const {
        for (int64_t r = y / side_ - 1; r <= y / side_ + 1; ++r)
            for (int64_t c = x / side_ - 1; c <= x / side_ + 1; ++c) {
                const auto found = in_.find({r, c});
                if (found != in_.end() &&
                    std::any_of(found->second.begin(), found->second.end(), test))
                    return true;
            }
        return false;
    }

  private:
    int64_t side_;
    std::map<std::pair<int64_t, int64_t>, std::vector<int64_t>> in_;
};

// Nodes and the links between them, and how long ways are.
class Network {
  public:
    struct Link {
        int64_t to, length;
    };

    explicit Network(int64_t n_nodes) : links_(n_nodes), total_(n_nodes, -1) {}

    const std::vector<Link> &links(int64_t node) const { return links_[node]; }

    void join(int64_t a, int64_t b, int64_t length) {
        links_[a].push_back({b, length});
        links_[b].push_back({a, length});
    }

    void part(int64_t a, int64_t b) {
        for (const auto &[from, to] : {std::pair{a, b}, std::pair{b, a}})
            std::erase_if(links_[from], [to = to](const Link &link) { return link.to == to; });
    }

    // Visit nodes at most `limit` away, the nearest first, until `stop(node, way)` says so.
    template <class Stop> void visit(int64_t start, int64_t limit, Stop stop) {
        const auto n_nodes = static_cast<int64_t>(links_.size());
        // Ways by their length, then by the node where they end, in one number.
        std::priority_queue<int64_t, std::vector<int64_t>, std::greater<>> ways;
        const auto reach = [&](int64_t node, int64_t way) {
            if (total_[node] < 0) touched_.push_back(node);
            total_[node] = way;
            ways.push(way * n_nodes + node);
        };
        reach(start, 0);
        while (!ways.empty()) {
            const int64_t node = ways.top() % n_nodes, here = ways.top() / n_nodes;
            ways.pop();
            if (here > total_[node]) continue;
            if (stop(node, here)) break;
            for (const Link &link : links_[node]) {
                const int64_t way = here + link.length;
                if (way <= limit && (total_[link.to] < 0 || way < total_[link.to]))
                    reach(link.to, way);
            }
        }
        for (const int64_t node : touched_) total_[node] = -1;
        touched_.clear();
    }

    // The length of the shortest way if it is at most `limit`, and else -1.
    int64_t way(int64_t start, int64_t goal, int64_t limit) {
        int64_t found = -1;
        visit(start, limit, [&](int64_t node, int64_t here) {
            if (node == goal) found = here;
            return node == goal;
        });
        return found;
    }

  private:
    std::vector<std::vector<Link>> links_;
    std::vector<int64_t> total_, touched_;
};

// Edges (M, 2) between nodes at (N, 2); selected edges do not cross.
class PlaneGraph {
  public:
    PlaneGraph(Array<const int64_t, 2> at, Array<const int64_t, 2> edges,
               Array<const int64_t, 1> length, Array<bool, 1> taken)
        : at_(at), edges_(edges), length_(length), taken_(taken), network_(at.shape(0)),
          nodes_(2 * longest(at, edges)), middles_(2 * longest(at, edges)) {}

    Network &network() { return network_; }

    // A node that edges must not pass. Positions are doubled, so that middles of edges are integers.
    void add_node(int64_t node) { nodes_.add(2 * at_(node, 0), 2 * at_(node, 1), node); }

    void take(int64_t m) {
        const auto [y, x] = middle(m);
        middles_.add(y, x, m);
        network_.join(edges_(m, 0), edges_(m, 1), length_(m));
        taken_(m) = true;
    }

    void give_back(int64_t m) {
        network_.part(edges_(m, 0), edges_(m, 1));
        taken_(m) = false;
    }

    // Whether an edge shortens a way, crosses none that is taken, and passes through no node.
    template <class IsNode> bool is_needed(int64_t m, double stretch, IsNode is_node) {
        const int64_t start = edges_(m, 0), goal = edges_(m, 1);
        const int64_t *a = place(start), *b = place(goal);
        const auto [y, x] = middle(m);
        const auto is_passed = [&](int64_t node) {
            return is_node(node) && node != start && node != goal && is_on(a, b, place(node));
        };
        const auto is_crossed = [&](int64_t other) {
            return taken_(other) && cross(a, b, place(edges_(other, 0)), place(edges_(other, 1)));
        };
        const auto most = static_cast<int64_t>(stretch * static_cast<double>(length_(m)));
        return start != goal && network_.way(start, goal, most) < 0 &&
               !nodes_.any(y, x, is_passed) && !middles_.any(y, x, is_crossed);
    }

  private:
    static int64_t longest(Array<const int64_t, 2> at, Array<const int64_t, 2> edges) {
        int64_t side = 1;
        for (int64_t m = 0; m < edges.shape(0); ++m)
            for (int64_t d = 0; d < 2; ++d)
                side = std::max(side, std::abs(at(edges(m, 0), d) - at(edges(m, 1), d)));
        return side;
    }

    const int64_t *place(int64_t node) const { return at_[node].data(); }

    std::pair<int64_t, int64_t> middle(int64_t m) const {
        const int64_t *a = place(edges_(m, 0)), *b = place(edges_(m, 1));
        return {a[0] + b[0], a[1] + b[1]};
    }

    Array<const int64_t, 2> at_, edges_;
    Array<const int64_t, 1> length_;
    Array<bool, 1> taken_;
    Network network_;
    Squares nodes_, middles_;
};

// Select edges (M, 2) between nodes at (N, 2) that form a plane graph with short paths.
//
// The greedy spanner (Althöfer et al., 1993) without crossings: `edges` come in order of preference,
// usually by `length` (M,). An edge is selected if every path over selected edges is over `stretch`
// times as long, and if it crosses no selected edge and passes through no node. Positions are integers
// from 0.
void plane_spanner(Array<const int64_t, 2> at, Array<const int64_t, 2> edges,
                   Array<const int64_t, 1> length, double stretch, Array<bool, 1> taken) {
    std::fill(taken.begin(), taken.end(), false);
    PlaneGraph graph(at, edges, length, taken);
    for (int64_t node = 0; node < at.shape(0); ++node) graph.add_node(node);
    for (int64_t m = 0; m < edges.shape(0); ++m)
        if (graph.is_needed(m, stretch, [](int64_t) { return true; })) graph.take(m);
}

// Remove nodes of a plane graph that are near others, unless a path gets too long.
//
// `edges` (M, 2) are all possible edges of nodes at (N, 2), by `length` (M,); `taken` (M,) and `kept`
// (N,) mark the edges and nodes of the plane graph, and both are changed. `order` lists the nodes to
// try. A node is removed if a remaining one is at most `apart` away. Edges between its neighbours are
// added as in the greedy spanner, and no path between them may become longer than before unless it is
// at most `detour` times the shortest over all edges, plus `slack`.
void leave_out_nodes(Array<const int64_t, 2> at, Array<const int64_t, 2> edges,
                     Array<const int64_t, 1> length, Array<const int64_t, 1> order, int64_t apart,
                     double stretch, double detour, int64_t slack, Array<bool, 1> taken,
                     Array<bool, 1> kept) {
    const int64_t n_nodes = at.shape(0);
    PlaneGraph graph(at, edges, length, taken);
    Network all(n_nodes);
    std::vector<std::vector<int64_t>> of(n_nodes);
    for (int64_t node = 0; node < n_nodes; ++node) graph.add_node(node);
    for (int64_t m = 0; m < edges.shape(0); ++m) {
        all.join(edges(m, 0), edges(m, 1), length(m));
        for (int64_t k = 0; k < 2; ++k) of[edges(m, k)].push_back(m);
        if (taken(m)) graph.take(m);
    }
    const auto other_end = [&](int64_t m, int64_t node) {
        return edges(m, 0) == node ? edges(m, 1) : edges(m, 0);
    };
    for (const int64_t node : order) {
        bool is_near = false;
        all.visit(node, apart, [&](int64_t other, int64_t) {
            is_near = other != node && kept(other);
            return is_near;
        });
        if (!is_near) continue;
        std::vector<int64_t> given, added, ends;
        int64_t reach = 0;
        for (const int64_t m : of[node])
            if (taken(m)) {
                given.push_back(m);
                ends.push_back(other_end(m, node));
                reach = std::max(reach, length(m));
            }
        std::vector<int64_t> most;
        for (std::size_t i = 0; i < ends.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) {
                const int64_t before = graph.network().way(ends[i], ends[j], 2 * reach);
                const int64_t shortest = all.way(ends[i], ends[j], before);
                most.push_back(std::max(before, slack + static_cast<int64_t>(
                                                            detour * static_cast<double>(shortest))));
            }
        for (const int64_t m : given) graph.give_back(m);
        kept(node) = false;
        std::vector<int64_t> between;
        for (const int64_t end : ends)
            for (const int64_t m : of[end])
                if (!taken(m) && edges(m, 0) == end &&
                    std::find(ends.begin(), ends.end(), edges(m, 1)) != ends.end())
                    between.push_back(m);
        std::sort(between.begin(), between.end());
        for (const int64_t m : between)
            if (graph.is_needed(m, stretch, [&](int64_t other) { return kept(other); })) {
                graph.take(m);
                added.push_back(m);
            }
        std::size_t pair = 0;
        bool is_good = true;
        for (std::size_t i = 0; i < ends.size(); ++i)
            for (std::size_t j = 0; j < i; ++j, ++pair)
                is_good = is_good && graph.network().way(ends[i], ends[j], most[pair]) >= 0;
        if (is_good) continue;
        for (const int64_t m : added) graph.give_back(m);
        for (const int64_t m : given) graph.take(m);
        kept(node) = true;
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("segment_clearances", segment_clearances, "blocked"_a, "ends"_a, "most"_a,
               "clearance"_a);
    module.add("stays_between", stays_between, "region"_a, "ends"_a, "stays"_a);
    module.add("plane_spanner", plane_spanner, "at"_a, "edges"_a, "length"_a, "stretch"_a,
               "taken"_a);
    module.add("leave_out_nodes", leave_out_nodes, "at"_a, "edges"_a, "length"_a, "order"_a,
               "apart"_a, "stretch"_a, "detour"_a, "slack"_a, "taken"_a, "kept"_a);
}
