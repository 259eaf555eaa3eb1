// Kernels on the raster of a plan: its largest rectangles, and a robot's way from stop to stop.

#include <tuple>
#include <vector>

#include <nanobind/stl/tuple.h>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

using Corners = std::tuple<int64_t, int64_t, int64_t, int64_t>;

// `x0, y0, x1, y1` of the largest rectangle that lies in `mask` (H, W), ends excluded.
//
// For each row, the largest rectangle under the histogram of the columns' heights above it, by a stack
// of rising heights: O(H W). Of equal ones the first met wins, row by row.
Corners largest_rectangle(Array<const bool, 2> mask) {
    struct Open {
        int64_t start, height;
    };
    const int64_t width = mask.shape(1);
    std::vector<int64_t> heights(width + 1, 0);  // the last stays 0 and ends every rectangle
    std::vector<Open> open;
    int64_t most = 0;
    Corners found = {0, 0, 0, 0};
    for (int64_t y = 0; y < mask.shape(0); ++y) {
        open.clear();
        for (int64_t x = 0; x <= width; ++x) {
            if (x < width) heights[x] = mask(y, x) ? heights[x] + 1 : 0;
            int64_t start = x;
            while (!open.empty() && open.back().height >= heights[x]) {
                const auto [left, height] = open.back();
                open.pop_back();
                start = left;
                if (height * (x - left) > most) {
                    most = height * (x - left);
                    found = {left, y + 1 - height, x, y + 1};
                }
            }
            open.push_back({start, heights[x]});
        }
    }
    return found;
}

// Searches over the cells of a raster in steps to the four sides, one after another.
class Search {
  public:
    explicit Search(Array<const bool, 2> drivable)
        : drivable_(drivable), came_from_(drivable.size(), -1) {}

    // The wanted cell that is reached in the fewest steps, or -1.
    template <class Wanted> int64_t find(int64_t start, Wanted is_wanted) {
        for (const int64_t cell : met_) came_from_[cell] = -1;
        met_.assign(1, start);
        came_from_[start] = start;
        const int64_t height = drivable_.shape(0), width = drivable_.shape(1);
        for (std::size_t next = 0; next < met_.size(); ++next) {
            const int64_t cell = met_[next], row = cell / width, column = cell % width;
            if (is_wanted(cell)) return cell;
            const auto go_to = [&](int64_t y, int64_t x) {
                if (y < 0 || y >= height || x < 0 || x >= width || !drivable_(y, x)) return;
                int64_t &before = came_from_[y * width + x];
                if (before >= 0) return;
                before = cell;
                met_.push_back(y * width + x);
            };
            go_to(row + 1, column);
            go_to(row - 1, column);
            go_to(row, column + 1);
            go_to(row, column - 1);
        }
        return -1;
    }

    // The cells that were met by the last search, each after the one that it was reached from.
    const std::vector<int64_t> &met() const { return met_; }
    int64_t came_from(int64_t cell) const { return came_from_[cell]; }

  private:
    Array<const bool, 2> drivable_;
    std::vector<int64_t> came_from_, met_;
};

// Cells every `spacing` steps of a way from stop to nearest stop, and how many there are.
//
// The way begins at the flat index `start` of `drivable` (H, W), the first of `out`, and goes on while
// `stops` (H, W), which are taken out as they are reached, can be reached and `out` has space.
int64_t drive(Array<const bool, 2> drivable, Array<bool, 2> stops, int64_t start, int64_t spacing,
              Array<int64_t, 1> out) {
    Search search(drivable);
    std::vector<int64_t> path;
    out(0) = start;
    int64_t n_out = 1, driven = 0, here = start;
    while (true) {
        const int64_t there = search.find(here, [&](int64_t cell) { return stops.data()[cell]; });
        if (there < 0) return n_out;
        stops.data()[there] = false;
        path.clear();
        for (int64_t cell = there; cell != here; cell = search.came_from(cell))
            path.push_back(cell);
        for (; !path.empty(); path.pop_back()) {
            if (++driven % spacing != 0 && path.size() > 1) continue;
            if (n_out == out.size()) return n_out;
            out(n_out++) = path.back();
        }
        here = there;
    }
}

// Write the least steps to the four sides from a flat index; `steps` (H, W) is -1 on entry, and where
// there is no way.
void steps_from(Array<const bool, 2> drivable, int64_t start, Array<int64_t, 2> steps) {
    Search search(drivable);
    search.find(start, [](int64_t) { return false; });
    int64_t *step = steps.data();
    for (const int64_t cell : search.met())
        step[cell] = cell == start ? 0 : step[search.came_from(cell)] + 1;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("largest_rectangle", largest_rectangle, "mask"_a);
    module.add("drive", drive, "drivable"_a, "stops"_a, "start"_a, "spacing"_a, "out"_a);
    module.add("steps_from", steps_from, "drivable"_a, "start"_a, "steps"_a);
}
