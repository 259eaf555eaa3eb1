// Gathers selected columns of a block of samples for scoring kernels.

#pragma once

#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace pgm {

constexpr int BLOCK = 128;  // samples whose used columns are worked on together

// Bytes of the registers that samples are compared in: GCC takes longer ones apart.
template <int BYTES> constexpr int COMPARED = std::min(BYTES, 32);

// Write `values(c, i) = X(start + i, columns(c))` for `i < size`; `columns` ascend.
//
// Squares of samples and columns are turned over in registers: columns that are wanted go to their
// rows of `values`, the others to its last row, which is one more than there are columns.
// Rows lie far apart in memory, so those of the next block are fetched meanwhile.
template <int BYTES>
PGM_INLINE void gather(const Array<const float, 2> &X, std::int64_t start, std::int64_t size,
                       const Array<const std::int64_t, 1> &columns, const Array<float, 2> &values) {
    constexpr int WIDTH = BYTES / sizeof(float);
    using L = Simd<float, WIDTH, BYTES>;
    const std::int64_t width = X.shape(1), last_row = X.shape(0) - 1, n_wanted = columns.size();
    if (width < WIDTH) {
        for (std::int64_t c = 0; c < n_wanted; ++c)
            for (std::int64_t i = 0; i < size; ++i) values(c, i) = X(start + i, columns(c));
        return;
    }
    for (std::int64_t c = 0; c < n_wanted;) {
        const std::int64_t left = std::min(columns(c), width - WIDTH);
        std::int64_t place[WIDTH];
        std::fill_n(place, WIDTH, n_wanted);
        for (; c < n_wanted && columns(c) < left + WIDTH; ++c) place[columns(c) - left] = c;
        for (std::int64_t i = 0; i < size; i += WIDTH) {
            L square[WIDTH];
            for (int k = 0; k < WIDTH; ++k) {
                const std::int64_t row = start + std::min(i + k, size - 1);
                square[k] = L::load(&X(row, left));
                __builtin_prefetch(&X(std::min(row + BLOCK, last_row), left), 0, 2);
            }
            transpose(square);
            for (int k = 0; k < WIDTH; ++k) square[k].store(&values(place[k], i));
        }
    }
}

// Write to `out(k, n)` what `add_group(k, values, total)` adds up for each group `k` and row `n`.
//
// It gets the `columns` of a block of samples, and adds to their `total` (BLOCK,).
template <int BYTES, class AddGroup>
PGM_INLINE void score_blocks(const Array<const float, 2> &X, std::int64_t start, std::int64_t stop,
                             const Array<const std::int64_t, 1> &columns,
                             const Array<double, 2> &out, AddGroup add_group) {
    const std::int64_t n_rows = columns.size() + 1;
    std::vector<float> room(n_rows * BLOCK);
    for (std::int64_t block = start; block < stop; block += BLOCK) {
        const std::int64_t size = std::min<std::int64_t>(BLOCK, stop - block);
        gather<BYTES>(X, block, size, columns, Array<float, 2>(room.data(), {n_rows, BLOCK}));
        for (std::int64_t k = 0; k < out.shape(0); ++k) {
            double total[BLOCK] = {};
            add_group(k, room.data(), total);
            std::copy_n(total, size, &out(k, block));
        }
    }
}

}  // namespace pgm
