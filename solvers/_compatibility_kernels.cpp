// Counting the pairs of labels that are neighbours on a raster.

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// Count (label here, label there) in the four directions with the larger index, (4, L, L).
//
// The directions are right, then the row above from left to right; negative labels are skipped.
void count_pairs(Array<const std::int16_t, 2> labels, Array<int64_t, 3> out) {
    const int64_t height = labels.shape(0), width = labels.shape(1);
    for (int64_t r = 0; r < height; ++r)
        for (int64_t c = 0; c < width; ++c) {
            const int64_t here = labels(r, c);
            if (here < 0) continue;
            if (c + 1 < width && labels(r, c + 1) >= 0) out(0, here, labels(r, c + 1)) += 1;
            if (r + 1 >= height) continue;
            for (int64_t dc = -1; dc < 2; ++dc)
                if (0 <= c + dc && c + dc < width && labels(r + 1, c + dc) >= 0)
                    out(2 + dc, here, labels(r + 1, c + dc)) += 1;
        }
}

}  // namespace

PGM_KERNELS(module) { module.add("count_pairs", count_pairs, "labels"_a, "out"_a); }
