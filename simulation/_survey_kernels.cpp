// Rays of a survey, followed cell by cell in whole numbers: the same cells on every platform.

#include <algorithm>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;
using std::uint8_t;

// As in simulated_mapping.py.
constexpr uint8_t SOLID = 1, GLASS = 2, RIM = 4;
constexpr int64_t HALF_SIDE = 128;

// Count in `passed` and `ended` (H, W) where the rays of all stations passed and ended.
//
// `kind` (H, W) holds each cell's bits; its outermost cells are the rim, where every ray is lost: a step
// moves by at most one row and column, so that none gets beyond. Ray `d` of station `s` is entry
// `s * len(fan) + d` of `through`, the steps that it may still go once it has met a pane, and of `late`,
// the steps by which its end is reported too far. `stations` (S, 2) are columns and rows; what a station
// sees is noted `offsets` (S, 2) beside its true place.
void follow_rays(Array<const uint8_t, 2> kind, Array<const int64_t, 2> fan,
                 Array<const int64_t, 2> stations, Array<const int64_t, 2> offsets,
                 Array<const int64_t, 1> through, Array<const int64_t, 1> late, int64_t n_steps,
                 Array<int32_t, 2> passed, Array<int32_t, 2> ended) {
    const int64_t height = kind.shape(0), width = kind.shape(1);
    // How far so many steps lead along rows or columns, rounded; the shift is a division that floors.
    const auto cells = [](int64_t steps, int64_t way) {
        return (steps * 2 * way + HALF_SIDE) >> 8;
    };
    static_assert(2 * HALF_SIDE == 1 << 8);
    for (int64_t s = 0; s < stations.shape(0); ++s) {
        const int64_t x0 = stations(s, 0), y0 = stations(s, 1);
        const int64_t noted_x = x0 + offsets(s, 0), noted_y = y0 + offsets(s, 1);
        for (int64_t d = 0; d < fan.shape(0); ++d) {
            const int64_t dx = fan(d, 0), dy = fan(d, 1), ray = s * fan.shape(0) + d;
            int64_t left = through(ray);
            bool behind = false;
            for (int64_t step = 1; step < n_steps; ++step) {
                const int64_t ahead_x = cells(step, dx), ahead_y = cells(step, dy);
                const uint8_t code = kind(y0 + ahead_y, x0 + ahead_x);
                if (code & RIM) break;
                behind = behind || (code & GLASS && left > 0);
                left -= behind;
                if (code & SOLID && !(behind && left > 0)) {
                    const int64_t far = step + late(ray);
                    const int64_t x = noted_x + cells(far, dx), y = noted_y + cells(far, dy);
                    ended(std::clamp<int64_t>(y, 0, height - 1),
                          std::clamp<int64_t>(x, 0, width - 1)) += 1;
                    break;
                }
                const int64_t x = noted_x + ahead_x, y = noted_y + ahead_y;
                if (0 <= x && x < width && 0 <= y && y < height) passed(y, x) += 1;
            }
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("follow_rays", follow_rays, "kind"_a, "fan"_a, "stations"_a, "offsets"_a,
               "through"_a, "late"_a, "n_steps"_a, "passed"_a, "ended"_a);
}
