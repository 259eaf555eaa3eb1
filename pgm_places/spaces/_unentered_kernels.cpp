// Pieces of free space around the cells where a disc can stand, and what borders them.
//
// All rasters have a frame of cells that are not open, wide enough that no loop has to ask whether a
// neighbour lies outside.

#include <algorithm>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Rows of sums; the first two are sides at walls and at unknown space.
enum Sum { AT_WALLS, AT_UNKNOWN, AT_OTHERS, N_FREE, LARGEST };

// Assign each open cell without a piece (-1) to the nearest growing piece, over sides.
//
// Of several pieces that are equally near, the one that comes first in the raster. `queue` is scratch
// for one entry per cell.
void grow_pieces(Array<const bool, 2> is_open, Array<const bool, 1> grows, Array<int32_t, 1> queue,
                 Array<int32_t, 2> piece) {
    const int64_t width = is_open.shape(1), size = is_open.size();
    const bool *open = is_open.data();
    int32_t *of = piece.data();
    const int64_t steps[4] = {-width, -1, 1, width};
    int64_t count = 0;
    for (int64_t i = width; i < size - width; ++i) {
        if (of[i] < 0 || !grows(of[i])) continue;
        const auto is_left = [&](int64_t step) { return of[i + step] < 0 && open[i + step]; };
        if (std::any_of(steps, steps + 4, is_left)) queue(count++) = static_cast<int32_t>(i);
    }
    for (int64_t done = 0; done < count; ++done)
        for (const int64_t step : steps) {
            const int64_t i = queue(done), j = i + step;
            if (of[j] >= 0 || !open[j]) continue;
            of[j] = of[i];
            queue(count++) = static_cast<int32_t>(j);
        }
}

// Per piece: sides at walls, at unknown space, at other pieces; free cells; largest value.
//
// `reach` is how far a wall may lie behind a border, in cells. `sums` (5, P) starts with zeros.
void sum_pieces(Array<const int32_t, 2> piece, Array<const bool, 2> is_open,
                Array<const std::int8_t, 2> cells, Array<const int32_t, 2> values, int64_t free,
                int64_t occupied, int64_t reach, Array<int64_t, 2> sums) {
    const int32_t *of = piece.data();
    const bool *open = is_open.data();
    const std::int8_t *cell = cells.data();
    const int64_t width = piece.shape(1);
    const auto has_wall = [&](int64_t from, int64_t step) {
        for (int64_t j = from + step; j != from + (reach + 1) * step && !open[j]; j += step)
            if (cell[j] == occupied) return true;
        return false;
    };
    for (int64_t i = 0; i < piece.size(); ++i) {
        const int32_t own = of[i];
        if (own < 0) continue;
        sums(N_FREE, own) += cell[i] == free;
        sums(LARGEST, own) = std::max<int64_t>(sums(LARGEST, own), values.data()[i]);
        for (const int64_t step : {-width, int64_t{-1}, int64_t{1}, width}) {
            if (open[i + step])
                sums(AT_OTHERS, own) += of[i + step] != own;
            else
                sums(has_wall(i, step) ? AT_WALLS : AT_UNKNOWN, own) += 1;
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("grow_pieces", grow_pieces, "is_open"_a, "grows"_a, "queue"_a, "piece"_a);
    module.add("sum_pieces", sum_pieces, "piece"_a, "is_open"_a, "cells"_a, "values"_a, "free"_a,
               "occupied"_a, "reach"_a, "sums"_a);
}
