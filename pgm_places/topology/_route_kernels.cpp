// Straight edges over the cells of a raster: their clearance, their regions, and which are needed.
//
// Positions are rows and columns in cells, integers being cell centres. A blocked cell is a square.

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
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

// Which edges (M, 2) a graph needs so that no way in it is `stretch` times too long.
//
// The greedy spanner (Althöfer et al., 1993): `edges` come in order of their `length` (M,), and one is
// needed if no way over those before is at most `stretch` times as long.
void needed_edges(Array<const int64_t, 2> edges, Array<const int64_t, 1> length, double stretch,
                  int64_t n_nodes, Array<bool, 1> needed) {
    struct Link {
        int64_t to, length;
    };
    std::vector<std::vector<Link>> links(n_nodes);
    std::vector<int64_t> total(n_nodes, -1), touched;
    for (int64_t m = 0; m < edges.shape(0); ++m) {
        const int64_t start = edges(m, 0), goal = edges(m, 1);
        const auto limit = static_cast<int64_t>(stretch * static_cast<double>(length(m)));
        // Ways by their length, then by the node where they end, in one number.
        std::priority_queue<int64_t, std::vector<int64_t>, std::greater<>> ways;
        const auto reach = [&](int64_t node, int64_t way) {
            if (total[node] < 0) touched.push_back(node);
            total[node] = way;
            ways.push(way * n_nodes + node);
        };
        needed(m) = true;
        reach(start, 0);
        while (!ways.empty()) {
            const int64_t node = ways.top() % n_nodes, here = ways.top() / n_nodes;
            ways.pop();
            if (node == goal) {
                needed(m) = false;
                break;
            }
            if (here > total[node]) continue;
            for (const Link &link : links[node]) {
                const int64_t way = here + link.length;
                if (way <= limit && (total[link.to] < 0 || way < total[link.to]))
                    reach(link.to, way);
            }
        }
        for (const int64_t node : touched) total[node] = -1;
        touched.clear();
        if (needed(m)) {
            links[start].push_back({goal, length(m)});
            links[goal].push_back({start, length(m)});
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("segment_clearances", segment_clearances, "blocked"_a, "ends"_a, "most"_a,
               "clearance"_a);
    module.add("stays_between", stays_between, "region"_a, "ends"_a, "stays"_a);
    module.add("needed_edges", needed_edges, "edges"_a, "length"_a, "stretch"_a, "n_nodes"_a,
               "needed"_a);
}
