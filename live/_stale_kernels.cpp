// Which scans may have touched one of some squares of cells.

#include <cmath>
#include <numbers>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// Set `stale` for the cells `first` to `end` that some beam of which may touch a square.
//
// `row_of` (N,) is the row of each cell in `reach` (R, S), the longest range of each sector of beams in
// cells, and in `farthest` (R,), the longest of all. `squares` (M, 3) holds row and column of each
// square's centre and half of its diagonal, in cells.
void mark_stale(Array<const int64_t, 2> cells_rc, Array<const int64_t, 1> row_of,
                Array<const float, 2> reach, Array<const float, 1> farthest,
                Array<const double, 2> squares, int64_t n_beams, int64_t first, int64_t end,
                Array<bool, 1> stale) {
    const auto may_touch = [&](int64_t i, int64_t m) {
        const double dy = squares(m, 0) - static_cast<double>(cells_rc(i, 0));
        const double dx = squares(m, 1) - static_cast<double>(cells_rc(i, 1));
        const double half = squares(m, 2), limit = farthest(row_of(i)) + half;
        const double square = dx * dx + dy * dy;
        if (square > limit * limit) return false;
        const double distance = std::sqrt(square);
        if (distance <= half) return true;
        // The beams between the tangents to the circle around the square, and one on each side.
        const double angle = std::atan2(dy, dx), spread = std::asin(half / distance);
        const auto beam_at = [&](double radians) {
            return radians * static_cast<double>(n_beams) / (2.0 * std::numbers::pi);
        };
        const auto low = static_cast<int64_t>(std::floor(beam_at(angle - spread))) - 1;
        const auto high = static_cast<int64_t>(std::ceil(beam_at(angle + spread))) + 1;
        for (int64_t beam = low; beam <= high; ++beam) {
            const int64_t turned = (beam % n_beams + n_beams) % n_beams;
            if (reach(row_of(i), turned * reach.shape(1) / n_beams) + half >= distance)
                return true;
        }
        return false;
    };
    for (int64_t i = first; i < end; ++i)
        for (int64_t m = 0; m < squares.shape(0) && !stale(i); ++m) stale(i) = may_touch(i, m);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("mark_stale", mark_stale, "cells_rc"_a, "row_of"_a, "reach"_a, "farthest"_a,
               "squares"_a, "n_beams"_a, "first"_a, "end"_a, "stale"_a);
}
