// Rays followed from cell to cell: exact, from anywhere, one by one.
//
// A ray crosses a column border every `per_x` and a row border every `per_y` cells of its length; the
// nearer of the two next crossings is taken. Where both coincide, at a corner of four cells, the
// column border is crossed first. `blocked` has a blocked rim, so that no ray leaves the array.

#include <cmath>
#include <limits>

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/sensing/_dda.hpp"

namespace {

using pgm::Array;
using pgm::sensing::BeamSteps;
using pgm::sensing::Cells;
using std::int64_t;

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double TINY = 1e-12;  // components below it are rounding left over from a right angle

// The steps of M beams; BeamSteps has the steps of one beam.
struct CentreBeams {
    Array<const int64_t, 1> step_x, step_y;
    Array<const double, 1> per_x, per_y;
    Array<const float, 1> metres_x, metres_y;
    auto fields() { return std::tie(step_x, step_y, per_x, per_y, metres_x, metres_y); }
    BeamSteps of(int64_t beam) const {
        return {step_x(beam), step_y(beam), per_x(beam), per_y(beam), metres_x(beam), metres_y(beam)};
    }
};

// Where scans are taken from, in cells; the cell that holds (x, y) is [floor y, floor x].
struct Poses {
    Array<const double, 1> x, y, headings_rad;
    auto fields() { return std::tie(x, y, headings_rad); }
};

// Ranges from the centres of n cells along M beams, to the rows `cells.nodes` of `out`.
void dda_from_centres(Array<const std::uint8_t, 2> blocked, Cells cells, CentreBeams beams,
                      double limit, float cap, Array<float, 2> out) {
    for (int64_t i = 0; i < cells.rows.size(); ++i) {
        const auto scan = out[cells.nodes(i)];
        for (int64_t beam = 0; beam < beams.step_x.size(); ++beam)
            scan(beam) = pgm::sensing::centre_range(blocked, cells.rows(i), cells.columns(i),
                                                    beams.of(beam), limit, cap);
    }
}

// Along one axis: the step, the length of ray for each cell, and that to the first border.
struct Way {
    int64_t step = 0;
    double per = INFINITE, next = INFINITE;

    Way(double along, double inside) {
        if (!(std::fabs(along) > TINY)) return;
        step = along > 0 ? 1 : -1;
        per = along > 0 ? 1.0 / along : -1.0 / along;
        next = (along > 0 ? 1.0 - inside : inside) * per;
    }
};

// Ranges (P, M) along the angles against each heading. A position in a blocked cell reads 0.
void dda_from_poses(Array<const std::uint8_t, 2> blocked, Poses poses,
                    Array<const double, 1> angles_rad, double resolution_m, double limit, float cap,
                    Array<float, 2> out) {
    for (int64_t i = 0; i < poses.x.size(); ++i) {
        const double x = poses.x(i), y = poses.y(i);
        const auto start_column = static_cast<int64_t>(std::floor(x));
        const auto start_row = static_cast<int64_t>(std::floor(y));
        const bool is_inside = blocked(start_row, start_column);
        for (int64_t beam = 0; beam < angles_rad.size(); ++beam) {
            if (is_inside) {
                out(i, beam) = 0.0f;
                continue;
            }
            const double angle = poses.headings_rad(i) + angles_rad(beam);
            Way across(std::cos(angle), x - start_column), up(std::sin(angle), y - start_row);
            int64_t row = start_row, column = start_column;
            float reading = cap;
            while (std::min(across.next, up.next) < limit) {
                const bool sideways = across.next <= up.next;
                const double travelled = sideways ? across.next : up.next;
                if (sideways) {
                    across.next += across.per;
                    column += across.step;
                } else {
                    up.next += up.per;
                    row += up.step;
                }
                if (blocked(row, column)) {
                    reading = std::min(static_cast<float>(travelled * resolution_m), cap);
                    break;
                }
            }
            out(i, beam) = reading;
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("dda_from_centres", dda_from_centres, "blocked"_a, "cells"_a, "beams"_a, "limit"_a,
               "cap"_a, "out"_a);
    module.add("dda_from_poses", dda_from_poses, "blocked"_a, "poses"_a, "angles_rad"_a,
               "resolution_m"_a, "limit"_a, "cap"_a, "out"_a);
}
