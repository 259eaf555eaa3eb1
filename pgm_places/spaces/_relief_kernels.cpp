// The relief that is cut into basins: the distance to the nearest wall, smoothed by one cell.

#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Write the sum of square roots over the 3 x 3 cells around each open cell, in units of 1 / unit.
//
// `relief` (H + 2, W + 2) has a frame of one cell and is 0 there and wherever `squared` is 0. Integer
// sums do not depend on the order of summation, so rotating the map changes nothing.
struct SmoothedRoots {
    template <int BYTES>
    static PGM_INLINE void run(Array<const int32_t, 2> squared, int64_t unit,
                               Array<int32_t, 2> relief) {
        const int64_t height = squared.shape(0), width = squared.shape(1);
        const auto scale = static_cast<double>(unit);
        std::vector<int32_t> roots(3 * (width + 2)), sums(width + 2);
        const auto roots_of = [&](int64_t row) { return roots.data() + row % 3 * (width + 2); };
        int32_t *__restrict sum = sums.data();
        std::fill(&relief(0, 0), &relief(0, 0) + width + 2, 0);
        std::fill(&relief(height + 1, 0), &relief(height + 1, 0) + width + 2, 0);
        for (int64_t r = -1; r < height; ++r) {
            const int32_t *below = roots_of(r + 2), *here = roots_of(r + 3);
            int32_t *__restrict above = roots_of(r + 4);
            if (r + 1 < height) {
                const int32_t *cells = &squared(r + 1, 0);
                for (int64_t c = 0; c < width; ++c)
                    above[c + 1] = static_cast<int32_t>(
                        std::sqrt(static_cast<double>(cells[c])) * scale + 0.5);
            } else {
                std::fill(above + 1, above + width + 1, 0);
            }
            if (r < 0) continue;
            for (int64_t c = 0; c < width + 2; ++c) sum[c] = below[c] + here[c] + above[c];
            int32_t *__restrict out = &relief(r + 1, 0);
            out[0] = out[width + 1] = 0;
            for (int64_t c = 1; c <= width; ++c)
                out[c] = here[c] > 0 ? sum[c - 1] + sum[c] + sum[c + 1] : 0;
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("smoothed_roots", pgm::variants<SmoothedRoots>, "squared"_a, "unit"_a, "relief"_a);
}
