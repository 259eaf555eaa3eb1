// One pass over the raster that sums up the shape of every basin.

#include <algorithm>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Columns of sums, then of positions.
enum Sum { HEIGHTS, FURNITURE, SIDES_AT_WALLS, SIDES_AT_UNKNOWN, ROWS, COLUMNS, RR, RC, CC };

// Sum over the cells of every basin into `total` (N, 9) and find its extents in cells.
//
// `basin` and `relief` have a frame. `low` and `high` (N, D) are the minimum and maximum projections of
// its cells onto the `directions` (D, 2); everything off the map is a wall.
void sum_basins(Array<const int32_t, 2> basin, Array<const int32_t, 2> relief,
                Array<const std::int8_t, 2> cells, int64_t free, int64_t unknown,
                Array<const double, 2> directions, Array<int64_t, 2> total, Array<double, 2> low,
                Array<double, 2> high) {
    const int64_t height = cells.shape(0), width = cells.shape(1);
    constexpr int STEPS[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    for (int64_t r = 0; r < height; ++r)
        for (int64_t c = 0; c < width; ++c) {
            const int32_t own = basin(r + 1, c + 1);
            if (own < 0) continue;
            int64_t *sums = &total(own, 0);
            sums[HEIGHTS] += relief(r + 1, c + 1);
            sums[FURNITURE] += cells(r, c) != free;
            sums[ROWS] += r;
            sums[COLUMNS] += c;
            sums[RR] += r * r;
            sums[RC] += r * c;
            sums[CC] += c * c;
            bool at_edge = false;
            for (const auto &step : STEPS) {
                const int64_t s = r + step[0], d = c + step[1];
                const int32_t other = basin(s + 1, d + 1);
                if (other == own) continue;
                at_edge = true;
                if (other >= 0) continue;
                const bool off = s < 0 || d < 0 || s >= height || d >= width;
                sums[!off && cells(s, d) == unknown ? SIDES_AT_UNKNOWN : SIDES_AT_WALLS] += 1;
            }
            if (!at_edge) continue;
            for (int64_t k = 0; k < directions.shape(0); ++k) {
                const double along = static_cast<double>(r) * directions(k, 0) +
                                     static_cast<double>(c) * directions(k, 1);
                low(own, k) = std::min(low(own, k), along);
                high(own, k) = std::max(high(own, k), along);
            }
        }
}

// Sums and extents of segments from their basins; -1 is no segment.
//
// On entry `total` (S, 9) is 0, `low` (S, D) infinite and `high` minus that.
void gather_basins(Array<const int32_t, 1> segment_of, Array<const int64_t, 2> basin_total,
                   Array<const double, 2> basin_low, Array<const double, 2> basin_high,
                   Array<int64_t, 2> total, Array<double, 2> low, Array<double, 2> high) {
    for (int64_t basin = 0; basin < segment_of.size(); ++basin) {
        const int32_t own = segment_of(basin);
        if (own < 0) continue;
        for (int64_t k = 0; k < total.shape(1); ++k) total(own, k) += basin_total(basin, k);
        for (int64_t k = 0; k < low.shape(1); ++k) {
            low(own, k) = std::min(low(own, k), basin_low(basin, k));
            high(own, k) = std::max(high(own, k), basin_high(basin, k));
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("sum_basins", sum_basins, "basin"_a, "relief"_a, "cells"_a, "free"_a, "unknown"_a,
               "directions"_a, "total"_a, "low"_a, "high"_a);
    module.add("gather_basins", gather_basins, "segment_of"_a, "basin_total"_a, "basin_low"_a,
               "basin_high"_a, "total"_a, "low"_a, "high"_a);
}
