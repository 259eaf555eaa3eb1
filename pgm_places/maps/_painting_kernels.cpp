// Which cell of a coarse map each cell of a finer one takes its value from.

#include <algorithm>
#include <cstdlib>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// A point, and half the side of a coarse cell, in units in which the centres of both maps' cells are
// whole numbers.
struct Point {
    int64_t y, x, half;

    int64_t squared_distance(int64_t row, int64_t column) const {
        const int64_t up = (2 * row + 1) * half - y, across = (2 * column + 1) * half - x;
        return up * up + across * across;
    }
};

// The free cell with the nearest centre, the first of equals; -1 where none is free.
//
// Rings of cells about the one that holds the point, until no further ring can be nearer: a centre of
// ring k is at least (2 k - 1) half sides away.
int64_t nearest_cell(const Array<const bool, 2> &free, int64_t row, int64_t column, Point point) {
    const int64_t height = free.shape(0), width = free.shape(1);
    int64_t best = -1, least = 0;
    for (int64_t ring = 1; ring < std::max(height, width); ++ring) {
        const int64_t away = (2 * ring - 1) * point.half;
        if (best >= 0 && least < away * away) break;
        for (int64_t r = std::max<int64_t>(row - ring, 0); r <= std::min(row + ring, height - 1); ++r) {
            const int64_t step = std::abs(r - row) == ring ? 1 : 2 * ring;
            for (int64_t c = column - ring; c <= column + ring; c += step) {
                if (c < 0 || c >= width || !free(r, c)) continue;
                const int64_t distance = point.squared_distance(r, c), at = r * width + c;
                if (best < 0 || distance < least || (distance == least && at < best)) {
                    best = at;
                    least = distance;
                }
            }
        }
    }
    return best;
}

// Write the flat index of the coarse cell behind each fine cell of a band of rows, or -1.
void source_cells(Array<const bool, 2> free, int64_t first, Array<const int64_t, 1> holder_row,
                  Array<const int64_t, 1> holder_column, Array<const bool, 2> coarse_free,
                  int64_t numerator, int64_t denominator, Array<int64_t, 2> out) {
    for (int64_t i = 0; i < free.shape(0); ++i) {
        const int64_t row = holder_row(i), y = (2 * (first + i) + 1) * denominator;
        for (int64_t j = 0; j < free.shape(1); ++j) {
            const int64_t column = holder_column(j), x = (2 * j + 1) * denominator;
            if (!free(i, j))
                out(i, j) = -1;
            else if (coarse_free(row, column))
                out(i, j) = row * coarse_free.shape(1) + column;
            else
                out(i, j) = nearest_cell(coarse_free, row, column, {y, x, numerator});
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("source_cells", source_cells, "free"_a, "first"_a, "holder_row"_a, "holder_column"_a,
               "coarse_free"_a, "numerator"_a, "denominator"_a, "out"_a);
}
