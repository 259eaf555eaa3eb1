// Thinning: cells are taken away in order of their clearance as long as nothing comes apart.
//
// A cell may go if its neighbours stay connected without it and no hole opens (it is a simple point;
// Yokoi's number of connectivity in the eight directions is one). Those nearest to a wall go first
// (Pudney, 1998), so that what is left runs along the middle.

#include <array>
#include <functional>
#include <queue>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Take cells of `inside` (H, W) away until none can go.
//
// Nothing is inside along the edges of the raster. `clearance` (H, W) says which cells go first, by row
// and column where it is the same; cells of `is_kept` (H, W) never go.
void thin(Array<bool, 2> inside, Array<const int32_t, 2> clearance, Array<const bool, 2> is_kept) {
    const int64_t width = inside.shape(1), n_cells = inside.size();
    bool *cells = inside.data();
    // To the neighbours, from the east counter-clockwise.
    const std::array around = {int64_t{1}, 1 - width, -width, -width - 1,
                               int64_t{-1}, width - 1, width, width + 1};
    const auto may_go = [&](int64_t cell) {
        int number = 0;
        for (int k = 0; k < 8; k += 2)
            number += !cells[cell + around[k]] &&
                      (cells[cell + around[k + 1]] || cells[cell + around[(k + 2) % 8]]);
        return number == 1;
    };
    std::vector<char> is_pending(n_cells, false);
    std::priority_queue<int64_t, std::vector<int64_t>, std::greater<>> queue;
    const auto put = [&](int64_t cell) {
        is_pending[cell] = true;
        queue.push(clearance.data()[cell] * n_cells + cell);
    };
    for (int64_t cell = 0; cell < n_cells; ++cell)
        if (cells[cell] && !is_kept.data()[cell] && may_go(cell)) put(cell);
    while (!queue.empty()) {
        const int64_t cell = queue.top() % n_cells;
        queue.pop();
        is_pending[cell] = false;
        if (!may_go(cell)) continue;
        cells[cell] = false;
        for (const int64_t step : around)
            if (cells[cell + step] && !is_kept.data()[cell + step] && !is_pending[cell + step])
                put(cell + step);
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("thin", thin, "inside"_a, "clearance"_a, "is_kept"_a);
}
