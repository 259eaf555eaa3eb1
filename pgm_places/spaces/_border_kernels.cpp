// The borders of basins: how high the passes between them are, and where.

#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/kernels/rows.hpp"

namespace {

using pgm::Array;
using pgm::Rows;
using std::int32_t;
using std::int64_t;

// The highest pass between each two basins; the passes of a basin form a list, the last one first.
struct Passes {
    Rows<int32_t, 3> rows;
    std::vector<int32_t> last, before;  // of a basin and of a row; -1 at the end

    explicit Passes(int64_t n_basins) : last(n_basins, -1) {}

    void note(int32_t a, int32_t b, int32_t height) {
        const auto [low, high] = std::minmax(a, b);
        int32_t at = last[low];
        while (at >= 0 && rows[at][1] != high) at = before[at];
        if (at >= 0) {
            rows[at][2] = std::max(rows[at][2], height);
            return;
        }
        before.push_back(last[low]);
        last[low] = static_cast<int32_t>(rows.size());
        rows.push_back({low, high, height});
    }
};

// (E, 3) pairs of adjacent basins, the smaller first, with the height of the pass; and (n,) the cells
// where a basin touches another one at a later cell, or that are on a line.
//
// The pass is the highest point of the border: the maximum, over all sites where the basins touch, of
// the lower of the two cells. Numbers from `count` on are lines between basins; there the pass is the
// cell of the line itself.
std::tuple<Rows<int32_t, 3>, Rows<int32_t>> highest_passes(Array<const int32_t, 1> basin,
                                                           Array<const int32_t, 1> relief,
                                                           Array<const int64_t, 1> steps,
                                                           int64_t count) {
    const int64_t width = -steps(0);
    Passes passes(count);
    Rows<int32_t> touching;
    for (int64_t i = width; i < basin.size() - width; ++i) {
        const int32_t here = basin(i);
        if (here < 0) continue;
        const bool on_line = here >= count;
        bool touches = on_line;
        for (int k = 1; k < 8; k += on_line ? 1 : 2) {  // each pair of cells once
            const int64_t one = i + steps(k);
            const int32_t a = basin(one);
            if (a == here || a < 0 || a >= count) continue;
            if (!on_line) {
                touches = true;
                passes.note(here, a, std::min(relief(i), relief(one)));
                continue;
            }
            for (int m = 0; m < k; ++m) {
                const int64_t other = i + steps(m);
                const int32_t b = basin(other);
                if (b >= 0 && b < count && b != a)
                    passes.note(a, b, std::min({relief(i), relief(one), relief(other)}));
            }
        }
        if (touches) touching.push_back({static_cast<int32_t>(i)});
    }
    return {std::move(passes.rows), std::move(touching)};
}

// (M, 7) the sites where segments touch, of the cells where basins do.
//
// Columns: row and column of the midpoint of the two cells in half cells (for a cell of a line, twice
// its own), the two basins, whether the cells share a side, whether both are free on the map (`cells`,
// without a frame), and the height. `segment_of` (D, B) are the segments of basins in each division.
Rows<int32_t, 7> border_sites(Array<const int32_t, 1> basin, Array<const int32_t, 1> relief,
                              Array<const int64_t, 1> steps, int64_t count,
                              Array<const int32_t, 2> segment_of, Array<const std::int8_t, 2> cells,
                              int64_t free, Array<const int32_t, 1> touching) {
    const auto width = static_cast<int32_t>(-steps(0));
    const auto apart = [&](int32_t a, int32_t b) {
        for (int64_t scale = 0; scale < segment_of.shape(0); ++scale)
            if (segment_of(scale, a) != segment_of(scale, b)) return true;
        return false;
    };
    Rows<int32_t, 7> sites;
    for (const int32_t i : touching) {
        const int32_t here = basin(i), row = i / width - 1, column = i % width - 1;
        const bool is_free = cells(row, column) == free;
        for (int k = 0; k < 8; ++k) {
            const auto one = static_cast<int32_t>(i + steps(k));
            const int32_t a = basin(one);
            if (a < 0 || a >= count) continue;
            if (here < count) {
                if (k % 2 == 0 || a == here || !apart(here, a)) continue;
                const int32_t r = one / width - 1, c = one % width - 1;
                sites.push_back({row + r, column + c, std::min(here, a), std::max(here, a), k < 4,
                                 is_free && cells(r, c) == free, std::min(relief(i), relief(one))});
                continue;
            }
            for (int m = 0; m < k; ++m) {
                const int64_t other = i + steps(m);
                const int32_t b = basin(other);
                if (b < 0 || b >= count || b == a || !apart(a, b)) continue;
                sites.push_back({2 * row, 2 * column, std::min(a, b), std::max(a, b), true, is_free,
                                 std::min({relief(i), relief(one), relief(other)})});
            }
        }
    }
    return sites;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("highest_passes", highest_passes, "basin"_a, "relief"_a, "steps"_a, "count"_a);
    module.add("border_sites", border_sites, "basin"_a, "relief"_a, "steps"_a, "count"_a,
               "segment_of"_a, "cells"_a, "free"_a, "touching"_a);
}
