// Runs of equal cells in the rows of a mask.

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// Runs of ones in each row of `mask`, as [begin, end) pairs; row i has starts[i:i+2].
//
// Returns the number of runs; runs beyond the length of `runs` (n, 2) are not written. `words` is the
// same memory as `mask`, eight cells a word, so that uniform stretches are skipped; the last cell of
// a row must be 0.
int64_t list_runs(Array<const std::uint64_t, 2> words, Array<const std::uint8_t, 2> mask,
                  Array<int64_t, 1> starts, Array<std::int32_t, 2> runs) {
    int64_t n = 0;
    for (int64_t i = 0; i < mask.shape(0); ++i) {
        starts(i) = n;
        int inside = 0;
        for (int64_t j = 0; j < words.shape(1); ++j) {
            if (words(i, j) == 0x0101010101010101u * static_cast<unsigned>(inside)) continue;
            for (int64_t k = 8 * j; k < 8 * j + 8; ++k) {
                if (mask(i, k) == inside) continue;
                if (n < runs.shape(0)) runs(n, inside) = static_cast<std::int32_t>(k);
                n += inside;
                inside = 1 - inside;
            }
        }
    }
    starts(mask.shape(0)) = n;
    return n;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("list_runs", list_runs, "words"_a, "mask"_a, "starts"_a, "runs"_a);
}
