// Kernels of mean field on a raster, whose neighbours follow from the cells' rows and columns.

#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;
using Cells = Array<const std::int32_t, 2>;

constexpr double INF = std::numeric_limits<double>::infinity();

// Fill `start` (H + 1,) with each row's first node; the first node out of order, or -1.
//
// `cells` (N, 2) are rows and columns, row by row, columns rising.
int64_t row_starts(Cells cells, Array<int64_t, 1> start) {
    const int64_t n_nodes = cells.shape(0);
    int64_t row = 0;
    start(0) = 0;
    for (int64_t i = 0; i < n_nodes; ++i) {
        if (i > 0 && cells(i, 0) == cells(i - 1, 0) && cells(i, 1) <= cells(i - 1, 1)) return i;
        if (cells(i, 0) < row) return i;
        while (row < cells(i, 0)) start(++row) = i;
    }
    while (row < start.shape(0) - 1) start(++row) = n_nodes;
    return -1;
}

// Add to `total` the beliefs of a row's nodes at most `reach` columns away.
//
// `at` is the first node that may be near enough; that of the next column on is returned.
int64_t add_row(const Cells &cells, const Array<float, 2> &beliefs, int64_t at, int64_t end,
                int64_t column, int64_t reach, std::vector<double> &total) {
    while (at < end && cells(at, 1) < column - reach) ++at;
    for (int64_t near = at; near < end && cells(near, 1) <= column + reach; ++near)
        for (std::size_t k = 0; k < total.size(); ++k) total[k] += beliefs(near, k);
    return at;
}

// Update the beliefs of every second row from `first` up to `last`.
//
// `table` (K, K) is the potential of an edge's first label and its second; `reach` is 1 if corners
// join cells, else 0. The largest change of a belief is returned.
double update_rows(Array<const double, 2> unary, Array<const double, 2> table, Cells cells,
                   Array<const int64_t, 1> start, int64_t first, int64_t last, int64_t reach,
                   double damping, Array<float, 2> beliefs) {
    const int64_t n_rows = start.shape(0) - 1, n_labels = unary.shape(1);
    std::vector<double> before(n_labels), after(n_labels), value(n_labels);
    double largest = 0.0;
    for (int64_t row = first; row < last; row += 2) {
        int64_t below = row > 0 ? start(row - 1) : 0, above = start(row + 1);
        const int64_t last_above = row + 2 <= n_rows ? start(row + 2) : above;
        for (int64_t i = start(row); i < start(row + 1); ++i) {
            const int64_t column = cells(i, 1);
            std::fill(before.begin(), before.end(), 0.0);
            std::fill(after.begin(), after.end(), 0.0);
            below = add_row(cells, beliefs, below, start(row), column, reach, before);
            above = add_row(cells, beliefs, above, last_above, column, reach, after);
            if (i > start(row) && cells(i - 1, 1) == column - 1)
                for (int64_t k = 0; k < n_labels; ++k) before[k] += beliefs(i - 1, k);
            if (i + 1 < start(row + 1) && cells(i + 1, 1) == column + 1)
                for (int64_t k = 0; k < n_labels; ++k) after[k] += beliefs(i + 1, k);
            double top = -INF;
            for (int64_t k = 0; k < n_labels; ++k) {
                value[k] = unary(i, k);
                for (int64_t other = 0; other < n_labels; ++other) {
                    // 0 times -inf counts nothing
                    if (before[other] > 0.0) value[k] += table(other, k) * before[other];
                    if (after[other] > 0.0) value[k] += table(k, other) * after[other];
                }
                top = std::max(top, value[k]);
            }
            // The neighbours together may forbid every label: then the node keeps its beliefs.
            if (top == -INF) continue;
            double total = 0.0;
            for (int64_t k = 0; k < n_labels; ++k) {
                value[k] = std::exp(value[k] - top);
                total += value[k];
            }
            for (int64_t k = 0; k < n_labels; ++k) {
                const float old = beliefs(i, k);
                const float fresh = static_cast<float>((1.0 - damping) * value[k] / total +
                                                       damping * static_cast<double>(old));
                const double change =
                    std::fabs(static_cast<double>(fresh) - static_cast<double>(old));
                largest = std::max(largest, change);
                beliefs(i, k) = fresh;
            }
        }
    }
    return largest;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("row_starts", row_starts, "cells"_a, "start"_a);
    module.add("update_rows", update_rows, "unary"_a, "table"_a, "cells"_a, "start"_a, "first"_a,
               "last"_a, "reach"_a, "damping"_a, "beliefs"_a);
}
