// The features of cells from the segments they are in, one run of cells at a time.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

constexpr double FARTHEST_M = 10.0;  // distances to the way out are capped here
constexpr int32_t RUN = 16;  // cells of a row that share a search: openings far behind the nearest
                             // are ruled out for all
constexpr double ROUNDING = 1e-6;
constexpr double INFINITE = std::numeric_limits<double>::infinity();

// An opening as a straight line from its middle minus a half to its middle plus a half.
struct Opening {
    double row, column, half_r, half_c, half_width;

    double away(double r, double c) const {
        double y = r - row, x = c - column;
        const double length = half_r * half_r + half_c * half_c;
        if (length > 0) {
            const double share = std::clamp((y * half_r + x * half_c) / length, -1.0, 1.0);
            y -= share * half_r;
            x -= share * half_c;
        }
        return std::sqrt(y * y + x * x);
    }
};

// The openings of a segment that may be nearest to some cell of a run, from column `low` to `high`.
//
// Measured from its middle, no distance is off by more than half its length.
class Search {
  public:
    explicit Search(Array<const double, 2> lines) : lines_(lines) {}

    void start(double row, double low, double high, int64_t first, int64_t end) {
        row_ = row;
        near_.clear();
        away_.clear();
        double nearest = INFINITE;
        for (int64_t e = first; e < end; ++e) {
            away_.push_back(line(e).away(row, (low + high) / 2));
            nearest = std::min(nearest, away_.back());
        }
        for (int64_t e = first; e < end; ++e)
            if (away_[e - first] <= nearest + (high - low) + ROUNDING) near_.push_back(line(e));
    }

    // The distance to the nearest opening and its half width; ties go to the wider one.
    std::pair<double, double> nearest(double column) const {
        std::pair<double, double> found = {INFINITE, 0.0};
        for (const Opening &opening : near_) {
            const double away = opening.away(row_, column);
            if (away < found.first || (away == found.first && opening.half_width > found.second))
                found = {away, opening.half_width};
        }
        return found;
    }

  private:
    Opening line(int64_t e) const {
        return {lines_(e, 0), lines_(e, 1), lines_(e, 2), lines_(e, 3), lines_(e, 4)};
    }

    Array<const double, 2> lines_;
    double row_ = 0.0;
    std::vector<Opening> near_;
    std::vector<double> away_;
};

// The end of the run from `first`: cells of one row and segment, at most `RUN` columns.
int64_t run_end(const Array<const int32_t, 2> &cells_rc, const Array<const int32_t, 1> &segment,
                int64_t first) {
    int64_t end = first + 1;
    while (end < cells_rc.shape(0) && segment(end) == segment(first) &&
           cells_rc(end, 0) == cells_rc(first, 0) && cells_rc(end - 1, 1) < cells_rc(end, 1) &&
           cells_rc(end, 1) < cells_rc(first, 1) + RUN)
        ++end;
    return end;
}

// Write columns of features: `found[n, target[k]]` is column `source[k]` of cell n.
//
// The columns of the segment in `table` (S, F) come first, followed by the distance to the wall over
// the segment's radius, the distance in metres to the nearest opening of the segment, at most 10, and
// that opening's half width; ties go to the wider opening. Openings are straight lines: rows of
// midpoint, half vector and half width; segment s has `lines[start[s]]` to `lines[start[s + 1]]`.
void write_features(Array<const int32_t, 2> cells_rc, Array<const int32_t, 1> segment,
                    Array<const double, 1> clearance, Array<const float, 2> table,
                    Array<const double, 1> radius, Array<const int64_t, 1> start,
                    Array<const double, 2> lines, double resolution_m,
                    Array<const int64_t, 1> source, Array<const int64_t, 1> target,
                    Array<float, 2> found) {
    const int64_t n_own = table.shape(1), n_columns = source.size();
    const bool searched = std::any_of(source.begin(), source.end(),
                                      [&](int64_t column) { return column > n_own; });
    Search search(lines);
    std::vector<float> values(n_own + 3);
    for (int64_t first = 0, end = 0; first < cells_rc.shape(0); first = end) {
        end = run_end(cells_rc, segment, first);
        const int32_t s = segment(first);
        if (searched)
            search.start(cells_rc(first, 0), cells_rc(first, 1), cells_rc(end - 1, 1), start(s),
                         start(s + 1));
        std::copy_n(table[s].begin(), n_own, values.begin());
        for (int64_t n = first; n < end; ++n) {
            values[n_own] = static_cast<float>(clearance(n) / radius(s));
            if (searched) {
                const auto [away, half_width] = search.nearest(cells_rc(n, 1));
                values[n_own + 1] = static_cast<float>(std::min(away * resolution_m, FARTHEST_M));
                values[n_own + 2] = static_cast<float>(half_width);
            }
            for (int64_t k = 0; k < n_columns; ++k) found(n, target(k)) = values[source(k)];
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("write_features", write_features, "cells_rc"_a, "segment"_a, "clearance"_a,
               "table"_a, "radius"_a, "start"_a, "lines"_a, "resolution_m"_a, "source"_a,
               "target"_a, "found"_a);
}
