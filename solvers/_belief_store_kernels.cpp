// The beliefs of a raster's nodes in a compact store.
//
// Only the parts of the raster that contain nodes are stored: blocks of BLOCK cells in a row, with the
// blocks around them so that every neighbour has a place. Cells that are not nodes have belief 0, which
// the multiplicative update preserves, so no mask is needed and whole blocks are updated.

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr int64_t BLOCK = 16;  // cells: one cache line of float32, one to four vectors

// Where a cell of the raster lies in the store.
int64_t cell_at(const Array<const std::int32_t, 2> &index, int64_t row, int64_t column) {
    return BLOCK * index(row + 1, column / BLOCK + 1) + column % BLOCK;
}

// Write node beliefs (n, K) into the store `out` (K, M).
void place_beliefs(Array<const double, 2> beliefs, Array<const std::int32_t, 2> cells,
                   Array<const std::int32_t, 2> index, Array<float, 2> out) {
    for (int64_t i = 0; i < cells.shape(0); ++i) {
        const int64_t at = cell_at(index, cells(i, 0), cells(i, 1));
        for (int64_t k = 0; k < beliefs.shape(1); ++k) out(k, at) = static_cast<float>(beliefs(i, k));
    }
}

// Read node beliefs (n, K) from the store (K, M), each row normalised once more.
void collect_beliefs(Array<const float, 2> store, Array<const std::int32_t, 2> cells,
                     Array<const std::int32_t, 2> index, Array<float, 2> out) {
    for (int64_t i = 0; i < cells.shape(0); ++i) {
        const int64_t at = cell_at(index, cells(i, 0), cells(i, 1));
        double total = 0.0;
        for (int64_t k = 0; k < out.shape(1); ++k) total += static_cast<double>(store(k, at));
        for (int64_t k = 0; k < out.shape(1); ++k)
            out(i, k) = static_cast<float>(static_cast<double>(store(k, at)) / total);
    }
}

// Write which neighbours of each node are walls: a bit per direction, or two counts.
//
// The counts are of walls that share a side (low four bits) and a corner (high four bits).
void code_walls(Array<const bool, 2> walls, Array<const std::int32_t, 2> cells,
                Array<const std::int32_t, 2> index, bool by_direction, Array<std::uint8_t, 1> out) {
    const int64_t height = walls.shape(0), width = walls.shape(1);
    for (int64_t i = 0; i < cells.shape(0); ++i) {
        const int64_t row = cells(i, 0), column = cells(i, 1);
        int code = 0, direction = 0;
        for (int64_t dr = -1; dr < 2; ++dr)
            for (int64_t dc = -1; dc < 2; ++dc) {
                if (dr == 0 && dc == 0) continue;
                const int64_t r = row + dr, c = column + dc;
                if (0 <= r && r < height && 0 <= c && c < width && walls(r, c))
                    code += by_direction ? 1 << direction : (dr == 0 || dc == 0 ? 1 : 16);
                direction += 1;
            }
        out(cell_at(index, row, column)) = static_cast<std::uint8_t>(code);
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("place_beliefs", place_beliefs, "beliefs"_a, "cells"_a, "index"_a, "out"_a);
    module.add("collect_beliefs", collect_beliefs, "store"_a, "cells"_a, "index"_a, "out"_a);
    module.add("code_walls", code_walls, "walls"_a, "cells"_a, "index"_a, "by_direction"_a, "out"_a);
}
