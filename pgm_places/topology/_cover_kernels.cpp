// A subset of cells that covers a region: every cell is near one of the subset.

#include <functional>
#include <queue>
#include <utility>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// Cells from which all others are within `reach` thousandths of a cell, along 8-neighbour steps.
//
// `order` (K,) lists positions in `inside` (H, W), which is false along the edges of the raster: the
// first `n_given` are taken, then each that none before is near enough to.
void cover_cells(Array<const bool, 2> inside, Array<const int64_t, 1> order, int64_t n_given,
                 int64_t reach, Array<bool, 1> taken) {
    const int64_t width = inside.shape(1);
    std::vector<int64_t> away(inside.size(), reach + 1);
    using Step = std::pair<int64_t, int64_t>;
    std::priority_queue<Step, std::vector<Step>, std::greater<>> steps;
    const auto arrive = [&](int64_t cell, int64_t distance) {
        if (distance >= away[cell]) return;
        away[cell] = distance;
        steps.push({distance, cell});
    };
    for (int64_t k = 0; k < order.shape(0); ++k) {
        taken(k) = k < n_given || away[order(k)] > reach;
        if (taken(k)) arrive(order(k), 0);
        while (!steps.empty()) {
            const auto [distance, cell] = steps.top();
            steps.pop();
            if (distance > away[cell]) continue;
            for (const int64_t down : {-width, int64_t{0}, width})
                for (const int64_t right : {-1, 0, 1}) {
                    // Not between two blocked cells that touch at a corner.
                    const bool *from = inside.data() + cell;
                    if (from[down + right] && from[down] && from[right])
                        arrive(cell + down + right, distance + (down && right ? 1414 : 1000));
                }
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("cover_cells", cover_cells, "inside"_a, "order"_a, "n_given"_a, "reach"_a,
               "taken"_a);
}
