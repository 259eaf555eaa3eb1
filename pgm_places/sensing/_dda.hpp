// One ray followed from cell to cell (Amanatides and Woo 1987).

#pragma once

#include <algorithm>
#include <cstdint>

#include "pgm_places/kernels/array.hpp"

namespace pgm::sensing {

// How one beam goes from cell to cell.
struct BeamSteps {
    std::int64_t step_x, step_y;  // -1, 0 or 1: the neighbouring column and row that it leads to
    double per_x, per_y;          // length of ray for each column and row, in cells; infinite
                                  // where none is left
    float metres_x, metres_y;     // the same in metres
};

// Cells that scans are taken from: (n,) each, and the row of the output of each.
struct Cells {
    Array<const std::int64_t, 1> rows, columns;
    Array<const std::int32_t, 1> nodes;
    auto fields() { return std::tie(rows, columns, nodes); }
};

// Range in metres from a cell's centre to the first blocked cell along one beam.
//
// A ray from a centre meets the k-th column border after k - 1/2 crossings' length, so that the
// range follows from the counts alone, without summing up. `limit` is the cap in cells.
inline __attribute__((always_inline)) float centre_range(const Array<const std::uint8_t, 2> &blocked,
                                                         std::int64_t row, std::int64_t column,
                                                         const BeamSteps &beam, double limit,
                                                         float cap) {
    float crossed_x = -0.5f, crossed_y = -0.5f;
    double next_x = 0.5 * beam.per_x, next_y = 0.5 * beam.per_y;
    while (std::min(next_x, next_y) < limit) {
        if (next_x <= next_y) {
            next_x += beam.per_x;
            crossed_x += 1.0f;
            column += beam.step_x;
            if (blocked(row, column)) return std::min(crossed_x * beam.metres_x, cap);
        } else {
            next_y += beam.per_y;
            crossed_y += 1.0f;
            row += beam.step_y;
            if (blocked(row, column)) return std::min(crossed_y * beam.metres_y, cap);
        }
    }
    return cap;
}

}  // namespace pgm::sensing
