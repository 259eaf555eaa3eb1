// Open space by runs: cells of a row side by side that are all free, or all not.

#include <algorithm>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/kernels/union_find.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// The runs of a raster, row after row; free ones and others alternate in a row.
struct Runs {
    std::vector<int32_t> first;  // (H + 1,) the first run of each row
    std::vector<int32_t> begin;  // the first column of each run
    std::vector<char> is_open;   // whether its cells are free
    int32_t width;

    Runs(const Array<const std::int8_t, 2> &cells, int64_t free)
        : width(static_cast<int32_t>(cells.shape(1))) {
        for (int64_t r = 0; r < cells.shape(0); ++r) {
            first.push_back(size());
            bool last = false;
            for (int32_t c = 0; c < width; ++c) {
                const bool is_free = cells(r, c) == free;
                if (c > 0 && is_free == last) continue;
                begin.push_back(c);
                is_open.push_back(is_free);
                last = is_free;
            }
        }
        first.push_back(size());
    }

    int32_t size() const { return static_cast<int32_t>(begin.size()); }
    int64_t n_rows() const { return static_cast<int64_t>(first.size()) - 1; }

    // The column behind a run of the row whose last run is before `after`.
    int32_t end(int32_t i, int32_t after) const { return i + 1 < after ? begin[i + 1] : width; }
};

// For each run of one side, a run that stands for its piece, which is its own.
//
// Runs of adjacent rows are connected if they share a column, or with `corners` = 1 a corner.
std::vector<int32_t> number_pieces(const Runs &runs, bool side, int32_t corners) {
    std::vector<int32_t> pieces(runs.size());
    const Array<int32_t, 1> parent(pieces.data(), {runs.size()});
    for (int32_t i = 0; i < runs.size(); ++i) parent(i) = i;
    const auto join = [&](int32_t a, int32_t b) {
        a = root(parent, a);
        b = root(parent, b);
        parent(std::max(a, b)) = std::min(a, b);
    };
    for (int64_t r = 0; r < runs.n_rows(); ++r) {
        const int32_t here = runs.first[r], after = runs.first[r + 1];
        int32_t before = runs.first[std::max<int64_t>(r - 1, 0)];
        for (int32_t i = here; i < after; ++i) {
            if (runs.is_open[i] != side) continue;
            const int32_t begin = runs.begin[i], end = runs.end(i, after);
            if (i > here && runs.is_open[i - 1] == side) join(i, i - 1);
            while (before < here && runs.end(before, here) + corners <= begin) ++before;
            for (int32_t j = before; j < here && runs.begin[j] < end + corners; ++j)
                if (runs.is_open[j] == side) join(i, j);
        }
    }
    for (int32_t i = 0; i < runs.size(); ++i) parent(i) = root(parent, i);
    return pieces;
}

// Close the open pieces of less than `least` cells.
void drop_spaces(Runs &runs, double least) {
    const std::vector<int32_t> piece = number_pieces(runs, true, 0);
    std::vector<int64_t> n_cells(runs.size());
    for (int64_t r = 0; r < runs.n_rows(); ++r)
        for (int32_t i = runs.first[r]; i < runs.first[r + 1]; ++i)
            n_cells[piece[i]] += runs.end(i, runs.first[r + 1]) - runs.begin[i];
    for (int32_t i = 0; i < runs.size(); ++i)
        if (runs.is_open[i] && static_cast<double>(n_cells[piece[i]]) < least)
            runs.is_open[i] = false;
}

// Cells of a piece, and the box around it.
struct Extent {
    int64_t n_cells = 0, bottom = 0, top = 0;
    int32_t left, right = 0;

    double squared_diagonal() const {
        const auto height = static_cast<double>(top - bottom);
        const auto across = static_cast<double>(right - left);
        return height * height + across * across;
    }
};

// Open the obstacles of less than `least` cells that are shorter than `longest`.
//
// The length is the diagonal of the box around a piece: the length of a thin piece at any angle.
void fill_furniture(Runs &runs, double least, double longest) {
    const std::vector<int32_t> piece = number_pieces(runs, false, 1);
    Extent nothing;
    nothing.left = runs.width;
    std::vector<Extent> extents(runs.size(), nothing);
    for (int64_t r = 0; r < runs.n_rows(); ++r)
        for (int32_t i = runs.first[r]; i < runs.first[r + 1]; ++i) {
            Extent &extent = extents[piece[i]];
            const int32_t end = runs.end(i, runs.first[r + 1]);
            if (extent.n_cells == 0) extent.bottom = r;
            extent.top = r + 1;
            extent.left = std::min(extent.left, runs.begin[i]);
            extent.right = std::max(extent.right, end);
            extent.n_cells += end - runs.begin[i];
        }
    for (int32_t i = 0; i < runs.size(); ++i) {
        const Extent &extent = extents[piece[i]];
        if (!runs.is_open[i] && static_cast<double>(extent.n_cells) < least &&
            extent.squared_diagonal() < longest * longest)
            runs.is_open[i] = true;
    }
}

// Write which cells are free or in an obstacle that is small and short.
//
// These have fewer than `least_obstacle` cells in a box with a diagonal under `longest_obstacle`.
// Pieces of fewer than `least_space` are left out. Obstacles are connected by sides and corners, open
// space by sides.
void open_cells(Array<const std::int8_t, 2> cells, int64_t free, double least_obstacle,
                double longest_obstacle, double least_space, Array<bool, 2> is_open) {
    Runs runs(cells, free);
    fill_furniture(runs, least_obstacle, longest_obstacle);
    drop_spaces(runs, least_space);
    for (int64_t r = 0; r < runs.n_rows(); ++r)
        for (int32_t i = runs.first[r]; i < runs.first[r + 1]; ++i)
            for (int32_t c = runs.begin[i]; c < runs.end(i, runs.first[r + 1]); ++c)
                is_open(r, c) = runs.is_open[i];
}

}  // namespace

PGM_KERNELS(module) {
    module.add("open_cells", open_cells, "cells"_a, "free"_a, "least_obstacle"_a,
               "longest_obstacle"_a, "least_space"_a, "is_open"_a);
}
