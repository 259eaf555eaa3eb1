// Rays across openings: the narrowest chord through a point, and the widths before and behind.

#include <algorithm>
#include <cmath>
#include <limits>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double BESIDE = 1e-6;

// The cells of a map, of which some are free; integer coordinates are cell centres.
struct Raster {
    Array<const std::int8_t, 2> cells;
    int64_t free;

    bool is_free(int64_t row, int64_t column) const {
        return 0 <= row && row < cells.shape(0) && 0 <= column && column < cells.shape(1) &&
               cells(row, column) == free;
    }

    // Length in cells of the free ray from (r, c), at most `longest`.
    //
    // Exact: traverses the cells along the ray side by side (Amanatides and Woo, 1987).
    double free_run(double r, double c, double dr, double dc, double longest) const {
        const double y = r + 0.5, x = c + 0.5;
        auto row = static_cast<int64_t>(std::floor(y)), column = static_cast<int64_t>(std::floor(x));
        if (!is_free(row, column)) return 0.0;
        const int step_r = dr > 0 ? 1 : -1, step_c = dc > 0 ? 1 : -1;
        const double every_r = dr != 0 ? std::abs(1 / dr) : INFINITE;
        const double every_c = dc != 0 ? std::abs(1 / dc) : INFINITE;
        double next_r = dr != 0 ? (static_cast<double>(row + (dr > 0)) - y) / dr : INFINITE;
        double next_c = dc != 0 ? (static_cast<double>(column + (dc > 0)) - x) / dc : INFINITE;
        while (true) {
            const double length = std::min(next_r, next_c);
            if (next_r < next_c) {
                row += step_r;
                next_r += every_r;
            } else {
                column += step_c;
                next_c += every_c;
            }
            if (length >= longest) return longest;
            if (!is_free(row, column)) return length;
        }
    }

    // The shorter of the free rays just to either side of (r, c).
    //
    // On the border of two cells, the length then does not depend on which cell the line is in.
    double clear_run(double r, double c, double dr, double dc, double longest) const {
        const double y = BESIDE * dc, x = -BESIDE * dr;
        r += BESIDE * dr;  // not in the cell behind
        c += BESIDE * dc;
        return std::min(free_run(r + y, c + x, dr, dc, longest),
                        free_run(r - y, c - x, dr, dc, longest));
    }
};

// Write the shortest chord through each point.
//
// `chord` is (G, 4): row and column of the midpoint, index of the direction, length in cells. Ties go
// to the first direction. `longest` bounds each half.
void narrowest_chords(Array<const std::int8_t, 2> cells, int64_t free,
                      Array<const double, 2> points_rc, Array<const double, 2> directions,
                      double longest, Array<double, 2> chord) {
    const Raster raster = {cells, free};
    for (int64_t g = 0; g < points_rc.shape(0); ++g) {
        const double r = points_rc(g, 0), c = points_rc(g, 1);
        double best = INFINITE;
        for (int64_t k = 0; k < directions.shape(0); ++k) {
            const double dr = directions(k, 0), dc = directions(k, 1);
            const double there = raster.clear_run(r, c, dr, dc, longest);
            const double back = raster.clear_run(r, c, -dr, -dc, longest);
            if (there + back >= best - 1e-4) continue;
            best = there + back;
            chord(g, 0) = r + dr * (there - back) / 2;
            chord(g, 1) = c + dc * (there - back) / 2;
            chord(g, 2) = static_cast<double>(k);
            chord(g, 3) = best;
        }
    }
}

// Write the width of the free space along parallel chords, 0 inside walls.
//
// Chords run along the unit vectors `along_rc` (G, 2) and are shifted by `offsets` (P,) cells along
// their normals (column, -row); `profile` is (G, P), in cells.
void width_profiles(Array<const std::int8_t, 2> cells, int64_t free,
                    Array<const double, 2> middle_rc, Array<const double, 2> along_rc,
                    Array<const double, 1> offsets, double longest, Array<double, 2> profile) {
    const Raster raster = {cells, free};
    for (int64_t g = 0; g < middle_rc.shape(0); ++g) {
        const double dr = along_rc(g, 0), dc = along_rc(g, 1);
        for (int64_t k = 0; k < offsets.size(); ++k) {
            const double r = middle_rc(g, 0) + offsets(k) * dc;
            const double c = middle_rc(g, 1) - offsets(k) * dr;
            const double there = raster.clear_run(r, c, dr, dc, longest);
            profile(g, k) = there + raster.clear_run(r, c, -dr, -dc, longest);
        }
    }
}

// Lower `nearest` (G,) to the distance of the nearest other gate; count the gates in reach.
//
// `field` (G,) is the square that a gate lies in, `order[start[f]]` to `order[start[f + 1]]` are the
// gates in square f. Only the squares around a gate's own are searched, so `nearest` must be no larger
// than their side, and `reach` too.
void distances_to_others(Array<const double, 2> centre, Array<const int64_t, 1> field,
                         Array<const int64_t, 1> start, Array<const int64_t, 1> order,
                         int64_t n_columns, double reach, Array<double, 1> nearest,
                         Array<double, 1> near) {
    const int64_t n_rows = (start.size() - 1) / n_columns;
    for (int64_t g = 0; g < centre.shape(0); ++g) {
        const int64_t row = field(g) / n_columns, column = field(g) % n_columns;
        double squared = nearest(g) * nearest(g);
        for (int64_t r = std::max<int64_t>(0, row - 1); r < std::min(n_rows, row + 2); ++r) {
            const int64_t first = r * n_columns + std::max<int64_t>(0, column - 1);
            const int64_t last = r * n_columns + std::min(n_columns, column + 2);
            for (int64_t at = start(first); at < start(last); ++at) {
                const int64_t other = order(at);
                if (other == g) continue;
                const double dx = centre(g, 0) - centre(other, 0);
                const double dy = centre(g, 1) - centre(other, 1);
                const double apart = dx * dx + dy * dy;
                squared = std::min(squared, apart);
                near(g) += apart <= reach * reach;
            }
        }
        nearest(g) = std::min(nearest(g), std::sqrt(squared));
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("narrowest_chords", narrowest_chords, "cells"_a, "free"_a, "points_rc"_a,
               "directions"_a, "longest"_a, "chord"_a);
    module.add("width_profiles", width_profiles, "cells"_a, "free"_a, "middle_rc"_a, "along_rc"_a,
               "offsets"_a, "longest"_a, "profile"_a);
    module.add("distances_to_others", distances_to_others, "centre"_a, "field"_a, "start"_a,
               "order"_a, "n_columns"_a, "reach"_a, "nearest"_a, "near"_a);
}
