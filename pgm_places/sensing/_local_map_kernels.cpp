// Evidence of a rolling map: scans written into it, rays followed through it.
//
// The map is a window of n x n cells on an unbounded plane. A cell of the plane is stored at its row
// and column modulo n, so that the window moves without copying; `wrap_row` and `wrap_column` are the
// storage indices of the window's first cell. Positions are in cells from the window's corner.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;
using std::int8_t;

constexpr double TINY = 1e-12;  // components below it are rounding left over from a right angle
constexpr double DEPTH = 0.1;   // cells behind the surface that a beam met: the matter lies there

// A rolling map's cells, each at its row and column modulo n.
struct Window {
    Array<int8_t, 2> evidence;      // (n, n) log-odds in steps; above 0 occupied, below 0 free
    Array<std::uint8_t, 2> seen;    // (n, n) number of the scan that changed a cell last
    int64_t wrap_row, wrap_column;  // storage indices of the window's first row and column
    auto fields() { return std::tie(evidence, seen, wrap_row, wrap_column); }

    int64_t n() const { return evidence.shape(0); }
    bool holds(int64_t row, int64_t column) const {
        return 0 <= row && row < n() && 0 <= column && column < n();
    }
    int64_t kept_row(int64_t row) const { return wrapped(row + wrap_row); }
    int64_t kept_column(int64_t column) const { return wrapped(column + wrap_column); }
    int64_t wrapped(int64_t place) const { return place >= n() ? place - n() : place; }
};

// Where a scan is taken, in cells from the window's corner.
struct Pose {
    double x, y, heading_rad;
    auto fields() { return std::tie(x, y, heading_rad); }
};

// What a scan adds to the evidence of a cell where a beam ends and where it crosses, and the bounds.
struct Steps {
    int64_t hit, miss, low, high;
    auto fields() { return std::tie(hit, miss, low, high); }
};

// A row and a column of the window.
struct Place {
    int64_t row, column;
    auto fields() { return std::tie(row, column); }
};

// What parts of the window become that hold occupied cells, free ones at most, or neither.
struct Values {
    int64_t occupied, free, unknown;
    auto fields() { return std::tie(occupied, free, unknown); }
};

// A ray along one axis: its cell, the step to the next, the length for each and to the next border.
struct Way {
    int64_t at, step = 0;
    double per = std::numeric_limits<double>::infinity(), next = per;

    Way(double along, double place) : at(static_cast<int64_t>(std::floor(place))) {
        const double inside = place - at;
        if (along > TINY) {
            step = 1;
            per = 1.0 / along;
            next = (1.0 - inside) / along;
        } else if (along < -TINY) {
            step = -1;
            per = -1.0 / along;
            next = -inside / along;
        }
    }
};

// Add a scan: what beams ended at is more occupied, what they crossed less.
//
// `lengths` are in cells; beams that are not above 0 say nothing. Each cell changes at most once,
// and an end counts before a crossing by another beam.
void write_scan(Window window, Pose pose, Array<const double, 1> lengths,
                Array<const double, 1> angles_rad, Steps steps, int64_t scan) {
    const auto &[evidence, seen, wrap_row, wrap_column] = window;
    const auto number = static_cast<std::uint8_t>(scan);
    for (int64_t beam = 0; beam < lengths.size(); ++beam) {
        if (!(lengths(beam) > 0.0)) continue;
        const double angle = pose.heading_rad + angles_rad(beam), reach = lengths(beam) + DEPTH;
        const auto column = static_cast<int64_t>(std::floor(pose.x + reach * std::cos(angle)));
        const auto row = static_cast<int64_t>(std::floor(pose.y + reach * std::sin(angle)));
        if (!window.holds(row, column)) continue;
        const int64_t r = window.kept_row(row), c = window.kept_column(column);
        if (seen(r, c) == number) continue;
        seen(r, c) = number;
        const int64_t more = std::max(evidence(r, c) + steps.hit, steps.low);
        evidence(r, c) = static_cast<int8_t>(std::min(more, steps.high));
    }
    for (int64_t beam = 0; beam < lengths.size(); ++beam) {
        const double length = lengths(beam);
        if (!(length > 0.0)) continue;
        const double angle = pose.heading_rad + angles_rad(beam);
        Way across(std::cos(angle), pose.x), up(std::sin(angle), pose.y);
        while (window.holds(up.at, across.at)) {
            const int64_t r = window.kept_row(up.at), c = window.kept_column(across.at);
            if (seen(r, c) != number) {
                seen(r, c) = number;
                if (evidence(r, c) > steps.low)
                    evidence(r, c) = static_cast<int8_t>(evidence(r, c) + steps.miss);
            }
            // Written without branches, which would be hard to foresee.
            const bool sideways = across.next <= up.next;
            const double crossed = sideways ? across.next : up.next;
            across.next += sideways ? across.per : 0.0;
            up.next += sideways ? 0.0 : up.per;
            across.at += sideways ? across.step : 0;
            up.at += sideways ? 0 : up.step;
            if (crossed >= length) break;
        }
    }
}

// Make cells whose centres lie within `radius` at most `value`: the robot stands there.
void write_disc(Window window, double x, double y, double radius, int64_t value) {
    const auto begin = [&](double at) {
        return std::max<int64_t>(static_cast<int64_t>(at - radius), 0);
    };
    const auto end = [&](double at) {
        return std::min<int64_t>(static_cast<int64_t>(at + radius) + 1, window.n());
    };
    for (int64_t row = begin(y); row < end(y); ++row)
        for (int64_t column = begin(x); column < end(x); ++column) {
            const double up = row + 0.5 - y, across = column + 0.5 - x;
            if (!(up * up + across * across <= radius * radius)) continue;
            int8_t &cell = window.evidence(window.kept_row(row), window.kept_column(column));
            cell = static_cast<int8_t>(std::min<int64_t>(cell, value));
        }
}

// Length of each ray in cells, to the first cell with evidence above 0; whether it met one.
//
// A ray that crosses more than `through` cells' length of unknown space in a row ends where that
// space began; space outside the window is unknown. `limit` where a ray met nothing so far.
void cast_rays(Window window, Pose pose, Array<const double, 1> angles_rad, double limit,
               double through, Array<double, 1> out, Array<bool, 1> met) {
    for (int64_t beam = 0; beam < angles_rad.size(); ++beam) {
        const double angle = pose.heading_rad + angles_rad(beam);
        Way across(std::cos(angle), pose.x), up(std::sin(angle), pose.y);
        double travelled = 0.0, unknown_from = -1.0, reading = limit;
        met(beam) = false;
        while (travelled < limit) {
            const bool inside = window.holds(up.at, across.at);
            const int value = inside ? window.evidence(window.kept_row(up.at),
                                                       window.kept_column(across.at))
                                     : 0;
            if (value > 0) {
                reading = travelled;
                met(beam) = true;
                break;
            }
            if (value < 0) {
                unknown_from = -1.0;
            } else {
                if (unknown_from < 0.0) unknown_from = travelled;
                // A ray that has left the window does not come back.
                const double leaves =
                    inside ? std::min(std::min(across.next, up.next), limit) : limit;
                if (leaves - unknown_from > through) {
                    reading = unknown_from;
                    break;
                }
                if (!inside) break;  // nothing more is known along this ray
            }
            if (across.next <= up.next) {
                travelled = across.next;
                across.next += across.per;
                across.at += across.step;
            } else {
                travelled = up.next;
                up.next += up.per;
                up.at += up.step;
            }
        }
        out(beam) = reading;
    }
}

// Update the largest and the smallest values so far, entry by entry.
void extend(const int8_t *values, int64_t n, int8_t *most, int8_t *least) {
    for (int64_t c = 0; c < n; ++c) {
        most[c] = std::max(most[c], values[c]);
        least[c] = std::min(least[c], values[c]);
    }
}

// Write a part of the window with `factor` x `factor` cells in one.
//
// The first of the `values` where any of them is occupied, else the second where any is free, else
// the third. The part goes from row and column `low` to `high`; cells beyond count as unknown.
void coarse_cells(Window window, Place low, Place high, int64_t factor, Values values,
                  Array<int8_t, 2> out) {
    const int64_t width = high.column - low.column;
    std::vector<int8_t> most(width), least(width);
    const int64_t kept_column = window.kept_column(low.column);
    // Number of columns before the storage wraps around.
    const int64_t before = std::min(width, window.n() - kept_column);
    for (int64_t r = 0; r < out.shape(0); ++r) {
        std::fill(most.begin(), most.end(), int8_t(0));
        std::fill(least.begin(), least.end(), int8_t(0));
        const int64_t first_row = low.row + r * factor;
        for (int64_t row = first_row; row < std::min(first_row + factor, high.row); ++row) {
            const auto evidence = window.evidence[window.kept_row(row)];
            extend(evidence.data() + kept_column, before, most.data(), least.data());
            extend(evidence.data(), width - before, most.data() + before, least.data() + before);
        }
        for (int64_t c = 0; c < out.shape(1); ++c) {
            int8_t top = 0, bottom = 0;
            for (int64_t column = c * factor; column < std::min((c + 1) * factor, width); ++column) {
                top = std::max(top, most[column]);
                bottom = std::min(bottom, least[column]);
            }
            out(r, c) = static_cast<int8_t>(top > 0      ? values.occupied
                                            : bottom < 0 ? values.free
                                                         : values.unknown);
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("write_scan", write_scan, "window"_a, "pose"_a, "lengths"_a, "angles_rad"_a,
               "steps"_a, "scan"_a);
    module.add("write_disc", write_disc, "window"_a, "x"_a, "y"_a, "radius"_a, "value"_a);
    module.add("cast_rays", cast_rays, "window"_a, "pose"_a, "angles_rad"_a, "limit"_a, "through"_a,
               "out"_a, "met"_a);
    module.add("coarse_cells", coarse_cells, "window"_a, "low"_a, "high"_a, "factor"_a, "values"_a,
               "out"_a);
}
