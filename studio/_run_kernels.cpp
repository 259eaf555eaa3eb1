// Loops over runs of cells: which of them an edit repaints, and what a brush passes over.

#include <algorithm>
#include <cmath>
#include <limits>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int16_t;
using std::int32_t;
using std::int64_t;

// Number of runs of cells that have one other label each; as many as fit are written.
int64_t differing_runs(Array<const int16_t, 2> labels, Array<const int64_t, 2> runs, int64_t label,
                       Array<int64_t, 2> found, Array<int16_t, 1> before) {
    int64_t count = 0;
    for (int64_t k = 0; k < runs.shape(0); ++k) {
        const int64_t row = runs(k, 0), start = runs(k, 1), length = runs(k, 2);
        int64_t left = label;
        for (int64_t column = start; column < start + length; ++column) {
            const int16_t old = labels(row, column);
            if (old != label) {
                if (old != left && ++count <= before.size()) {
                    found(count - 1, 0) = row;
                    found(count - 1, 1) = column;
                    found(count - 1, 2) = 0;
                    before(count - 1) = old;
                }
                if (count <= before.size()) found(count - 1, 2) += 1;
            }
            left = old;
        }
    }
    return count;
}

// Give the cells of each run its value.
void write_runs(Array<int16_t, 2> labels, Array<const int64_t, 2> runs,
                Array<const int16_t, 1> values) {
    for (int64_t k = 0; k < runs.shape(0); ++k)
        for (int64_t column = runs(k, 1); column < runs(k, 1) + runs(k, 2); ++column)
            labels(runs(k, 0), column) = values(k);
}

constexpr double INF = std::numeric_limits<double>::infinity();

// Columns from `low` to `high`; none if the second lies before the first.
struct Span {
    double low, high;
};

// A line from its start, drawn with a brush that covers what is at most `reach` from it.
class Line {
  public:
    Line(Array<const double, 1> line, double reach)
        : row0_(line(0)), column0_(line(1)), row1_(line(2)), column1_(line(3)), reach_(reach),
          down_(row1_ - row0_), right_(column1_ - column0_), square_(down_ * down_ + right_ * right_),
          length_(std::sqrt(square_)) {}

    // The rows that it covers, and some more.
    double top() const { return std::min(row0_, row1_) - reach_ - 1.0; }
    double bottom() const { return std::max(row0_, row1_) + reach_ + 2.0; }

    // What it covers of a row, but for rounding: the least span that holds those of the discs around
    // both ends and of the rectangle between. What is near a straight line is convex.
    Span across(double row) const {
        Span span = {INF, -INF};
        const auto widen = [&](double low, double high) {
            span = {std::min(span.low, low), std::max(span.high, high)};
        };
        for (const auto &[end_row, end_column] : {Point{row0_, column0_}, Point{row1_, column1_}}) {
            const double half2 = reach_ * reach_ - (row - end_row) * (row - end_row);
            if (half2 >= 0.0) widen(end_column - std::sqrt(half2), end_column + std::sqrt(half2));
        }
        if (length_ > 0.0) {
            const auto [near, far] = beside(row - row0_);
            if (near <= far) widen(column0_ + near, column0_ + far);
        }
        return span;
    }

    // Whether it covers a point.
    bool covers(double row, double column) const {
        double share = (row - row0_) * down_ + (column - column0_) * right_;
        share = std::clamp(share / std::max(square_, 1e-12), 0.0, 1.0);
        const double away_down = row - row0_ - share * down_;
        const double away_right = column - column0_ - share * right_;
        return away_down * away_down + away_right * away_right <= reach_ * reach_;
    }

  private:
    struct Point {
        double row, column;
    };

    // What the rectangle covers of the row so far below the start, from the start's column.
    Span beside(double below) const {
        Span span = {-INF, INF};
        const auto narrow = [&](double low, double high) {
            span = {std::max(span.low, low), std::min(span.high, high)};
        };
        // Along the line from its start to its end ...
        if (right_ != 0.0) {
            const double one = -below * down_ / right_;
            const double other = (length_ * length_ - below * down_) / right_;
            narrow(std::min(one, other), std::max(one, other));
        } else if (below * down_ < 0.0 || below * down_ > length_ * length_) {
            span.high = -INF;
        }
        // ... and across it at most the reach to either side.
        if (down_ != 0.0) {
            const double middle = below * right_ / down_, half = std::abs(reach_ * length_ / down_);
            narrow(middle - half, middle + half);
        } else if (std::abs(below * right_) > reach_ * length_) {
            span.high = -INF;
        }
        return span;
    }

    double row0_, column0_, row1_, column1_, reach_, down_, right_, square_, length_;
};

// Number of spans marked: the cells of a row that are at most `reach` from a line.
//
// `turns` covers a part of the raster and has one column to spare: 1 is added where a span begins, and
// taken away behind its end. `lines` (n, 4) hold rows before columns, start before end.
int64_t mark_brush(Array<const double, 2> lines, double reach, int64_t first_row,
                   int64_t first_column, Array<int32_t, 2> turns) {
    const int64_t n_rows = turns.shape(0), n_columns = turns.shape(1) - 1;
    const auto clipped = [&](double row) {
        const double inside = row - static_cast<double>(first_row);
        return static_cast<int64_t>(std::clamp(inside, 0.0, static_cast<double>(n_rows)));
    };
    int64_t count = 0;
    for (int64_t k = 0; k < lines.shape(0); ++k) {
        const Line line(lines[k], reach);
        for (int64_t r = clipped(line.top()); r < clipped(line.bottom()); ++r) {
            const auto row = static_cast<double>(first_row + r);
            auto [low, high] = line.across(row);
            low = std::max(std::ceil(low) - 1.0, static_cast<double>(first_column));
            high = std::min(std::floor(high) + 1.0,
                            static_cast<double>(first_column + n_columns - 1));
            // The ends were rounded: the definition decides which cells they are.
            while (low <= high && !line.covers(row, low)) low += 1.0;
            while (low <= high && !line.covers(row, high)) high -= 1.0;
            if (low > high) continue;
            turns(r, static_cast<int64_t>(low) - first_column) += 1;
            turns(r, static_cast<int64_t>(high) - first_column + 1) -= 1;
            ++count;
        }
    }
    return count;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("differing_runs", differing_runs, "labels"_a, "runs"_a, "label"_a, "found"_a,
               "before"_a);
    module.add("write_runs", write_runs, "labels"_a, "runs"_a, "values"_a);
    module.add("mark_brush", mark_brush, "lines"_a, "reach"_a, "first_row"_a, "first_column"_a,
               "turns"_a);
}
