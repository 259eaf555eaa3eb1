// Outlines of pieces along the sides of their cells, and which of their vertices to drop.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;
using std::uint8_t;

// The number of rings; writes their vertices (row, column of cell corners) consecutively.
//
// A piece is to the left of its rings: outlines run counter-clockwise (x right, y up), holes clockwise.
// Where a piece touches itself at a corner, the ring follows the same cell. Vertices are turns and
// fixed points, where three pieces or two pairs meet. `visited` (H, W), false on entry, marks the cells
// whose lower side has been passed.
int64_t trace_rings(Array<const int32_t, 2> piece, Array<bool, 2> visited, Array<int32_t, 2> points,
                    Array<bool, 1> is_fixed, Array<int32_t, 1> ring_start,
                    Array<int32_t, 1> ring_piece) {
    constexpr int EAST = 0;  // then north, west and south
    constexpr int UP[] = {0, 1, 0, -1}, RIGHT[] = {1, 0, -1, 0};
    const int64_t height = piece.shape(0), width = piece.shape(1);
    const auto piece_at = [&](int64_t r, int64_t c) {
        return r < 0 || c < 0 || r >= height || c >= width ? -1 : piece(r, c);
    };
    int64_t n_rings = 0, n_points = 0;
    ring_start(0) = 0;
    for (int64_t r = 0; r < height; ++r)
        for (int64_t c = 0; c < width; ++c) {
            const int32_t own = piece(r, c);
            if (own < 0 || visited(r, c) || piece_at(r - 1, c) == own) continue;
            int64_t y = r, x = c;
            int heading = EAST;
            while (heading != EAST || !visited(y, x)) {
                if (heading == EAST) visited(y, x) = true;
                y += UP[heading];
                x += RIGHT[heading];
                // The cells around this corner: the one ahead on the left is number `heading`.
                const std::array<int32_t, 4> around = {piece_at(y, x), piece_at(y, x - 1),
                                                       piece_at(y - 1, x - 1), piece_at(y - 1, x)};
                const int before = heading;
                if (around[heading] != own) {
                    heading = (heading + 1) % 4;
                } else if (around[(heading + 3) % 4] == own) {
                    heading = (heading + 3) % 4;
                }
                // Two pieces meet along a line or at one corner; all else stays where it is.
                int sides = 0;
                for (int k = 0; k < 4; ++k) sides += around[k] != around[(k + 1) % 4];
                if (sides > 2 || heading != before) {
                    points(n_points, 0) = static_cast<int32_t>(y);
                    points(n_points, 1) = static_cast<int32_t>(x);
                    is_fixed(n_points++) = sides > 2;
                }
            }
            ring_piece(n_rings++) = own;
            ring_start(n_rings) = static_cast<int32_t>(n_points);
        }
    return n_rings;
}

struct Point {
    int64_t y, x;
    bool operator==(const Point &) const = default;
    Point operator-(const Point &other) const { return {y - other.y, x - other.x}; }
};

// The vertices of an arc, by their place along it, and the raster of states that they are dropped from.
class Arc {
  public:
    static constexpr uint8_t VERTEX = 1, DONE = 2;

    Arc(Array<const int32_t, 2> points, Array<const int32_t, 1> order, int64_t n,
        Array<uint8_t, 2> state)
        : points_(points), order_(order), n_(n), state_(state) {}

    bool is_done() const { return state_at((*this)(1)) & DONE; }

    // Simplify it, keeping the vertex farthest from its chord so that it never vanishes.
    void simplify(double tolerance) const {
        for (int64_t k = 1; k < n_ - 1; ++k) state_at((*this)(k)) |= DONE;
        const auto halves = [&](int64_t first, int64_t last) {
            const int64_t middle = farthest(first, last);
            thin_out(first, middle, tolerance);
            thin_out(middle, last, tolerance);
        };
        if ((*this)(0) == (*this)(n_ - 1)) {  // each half of a ring has to keep a vertex too
            const int64_t middle = farthest(0, n_ - 1);
            halves(0, middle);
            halves(middle, n_ - 1);
        } else {
            halves(0, n_ - 1);
        }
    }

  private:
    Point operator()(int64_t k) const { return {points_(order_(k), 0), points_(order_(k), 1)}; }
    uint8_t &state_at(Point point) const { return state_(point.y, point.x); }

    // The vertex farthest from the chord, or from the first vertex if the arc is closed.
    int64_t farthest(int64_t first, int64_t last) const {
        const Point u = (*this)(last) - (*this)(first);
        int64_t best = first + 1, most = -1;
        for (int64_t k = first + 1; k < last; ++k) {
            const Point v = (*this)(k) - (*this)(first);
            const int64_t distance = u == Point{0, 0} ? v.y * v.y + v.x * v.x
                                                      : std::abs(u.x * v.y - u.y * v.x);
            if (distance > most) {
                best = k;
                most = distance;
            }
        }
        return best;
    }

    // Walk along it and drop vertices while the chord stays close to all it skips.
    void thin_out(int64_t first, int64_t last, double tolerance) const {
        int64_t anchor = first, before = first + 1;
        for (int64_t k = first + 2; k <= last; before = k++) {
            if (is_close(anchor, k, tolerance) &&
                is_empty((*this)(anchor), (*this)(before), (*this)(k)))
                state_at((*this)(before)) &= static_cast<uint8_t>(~VERTEX);
            else
                anchor = before;
        }
    }

    // Whether all vertices between are within the tolerance of the segment from first to last.
    bool is_close(int64_t first, int64_t last, double tolerance) const {
        const Point u = (*this)(last) - (*this)(first);
        const double ux = static_cast<double>(u.x), uy = static_cast<double>(u.y);
        const double square = ux * ux + uy * uy;
        for (int64_t k = first + 1; k < last; ++k) {
            const Point v = (*this)(k) - (*this)(first);
            const double vx = static_cast<double>(v.x), vy = static_cast<double>(v.y);
            const double along = square > 0.0 ? (ux * vx + uy * vy) / square : 0.0;
            const double t = std::clamp(along, 0.0, 1.0);
            const double dx = vx - t * ux, dy = vy - t * uy;
            if (!(dx * dx + dy * dy <= tolerance * tolerance)) return false;
        }
        return true;
    }

    // Whether the triangle, including its sides, contains no vertex but its own corners.
    bool is_empty(Point a, Point b, Point c) const {
        if (a == c) return false;
        const auto [lowest, highest] = std::minmax({a.y, b.y, c.y});
        for (int64_t y = lowest; y <= highest; ++y) {
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (const auto &[from, to] : {std::pair{a, b}, {b, c}, {c, a}}) {
                if (y < std::min(from.y, to.y) || y > std::max(from.y, to.y)) continue;
                double x = static_cast<double>(from.x);
                // A side along the row has both its ends as ends of the others.
                if (from.y != to.y)
                    x += static_cast<double>((to.x - from.x) * (y - from.y)) /
                         static_cast<double>(to.y - from.y);
                low = std::min(low, x);
                high = std::max(high, x);
            }
            const auto last = static_cast<int64_t>(std::floor(high + 1e-9));
            for (auto x = static_cast<int64_t>(std::ceil(low - 1e-9)); x <= last; ++x) {
                const Point point = {y, x};
                if (point != a && point != b && point != c && state_at(point) & VERTEX)
                    return false;
            }
        }
        return true;
    }

    Array<const int32_t, 2> points_;
    Array<const int32_t, 1> order_;
    int64_t n_;
    Array<uint8_t, 2> state_;
};

// Remove vertices from `state` (H + 1, W + 1), which is VERTEX at all of them.
//
// Between two fixed points, a border is one arc shared by two pieces and is simplified once. A vertex
// is removed only if the triangle with its neighbours contains no other vertex, so borders never
// cross, and if every removed vertex stays within `tolerance` (cells) of the new line. `order` is
// scratch, two longer than the longest ring.
void simplify_arcs(Array<const int32_t, 2> points, Array<const bool, 1> is_fixed,
                   Array<const int32_t, 1> ring_start, double tolerance, Array<uint8_t, 2> state,
                   Array<int32_t, 1> order) {
    const auto is_earlier = [&](int32_t i, int32_t j) {
        return std::pair{points(i, 0), points(i, 1)} < std::pair{points(j, 0), points(j, 1)};
    };
    for (int64_t ring = 0; ring < ring_start.size() - 1; ++ring) {
        const int32_t first = ring_start(ring), stop = ring_start(ring + 1), length = stop - first;
        // Start at a fixed vertex, or else at the very first one, which is the same for both pieces.
        int32_t begin = first;
        for (int32_t i = first; i < stop; ++i) {
            if (is_fixed(i) || is_earlier(i, begin)) begin = i;
            if (is_fixed(i)) break;
        }
        int64_t n = 0;
        for (int32_t step = 0; step <= length; ++step) {
            const int32_t i = begin + step < stop ? begin + step : begin + step - length;
            order(n++) = i;
            if (step == 0 || !(is_fixed(i) || step == length)) continue;
            const Arc arc(points, order, n, state);
            if (n > 2 && !arc.is_done()) arc.simplify(tolerance);
            order(0) = i;
            n = 1;
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("trace_rings", trace_rings, "piece"_a, "visited"_a, "points"_a, "is_fixed"_a,
               "ring_start"_a, "ring_piece"_a);
    module.add("simplify_arcs", simplify_arcs, "points"_a, "is_fixed"_a, "ring_start"_a,
               "tolerance"_a, "state"_a, "order"_a);
}
