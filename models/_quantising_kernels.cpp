// Kernels that prepare features for boosting: bins, joint tables, members of a bin.

#include <cstring>
#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr int N_BINS = 256;
constexpr int BLOCK = 64;  // rows transposed together: their codes fill a cache line of every feature

// Write how many of 256 ascending edges are <= each value; the last edge is infinite.
//
// Vectors are compared with every sixteenth edge; the rest of the search is written out, because a
// loop would branch on every comparison.
PGM_INLINE void count_edges(const float *edge, const float *values, std::int32_t *counts) {
    for (int i = 0; i < BLOCK; ++i) counts[i] = 0;
    for (int k = 15; k < N_BINS - 1; k += 16)
        for (int i = 0; i < BLOCK; ++i) counts[i] += edge[k] <= values[i];
    for (int i = 0; i < BLOCK; ++i) {
        const float x = values[i];
        std::int32_t c = 16 * counts[i];
        c += 8 * (edge[c + 7] <= x);
        c += 4 * (edge[c + 3] <= x);
        c += 2 * (edge[c + 1] <= x);
        counts[i] = c + (edge[c] <= x);
    }
}

// Write `codes(j, n)`, the number of edges of feature `j` that are <= its value at row `n`.
//
// `edges[j]` ascends and is filled up with infinity to 256 entries.
struct Quantise {
    template <int BYTES>
    static PGM_INLINE void run(Array<const float, 2> X, Array<const int64_t, 1> rows,
                               Array<const float, 2> edges, int64_t start, int64_t stop,
                               Array<std::uint8_t, 2> codes) {
        const int64_t n_features = X.shape(1);
        std::vector<float> values(n_features * BLOCK);
        for (int64_t block = start; block < stop; block += BLOCK) {
            const int64_t size = std::min<int64_t>(BLOCK, stop - block);
            for (int64_t i = 0; i < size; ++i) {
                const float *row = &X(rows(block + i), 0);
                for (int64_t j = 0; j < n_features; ++j) values[j * BLOCK + i] = row[j];
            }
            for (int64_t j = 0; j < n_features; ++j) {
                std::int32_t counts[BLOCK];
                count_edges(&edges(j, 0), &values[j * BLOCK], counts);
                std::copy_n(counts, size, &codes(j, block));
            }
        }
    }
};

// Write how many examples each of the 256 bins of one feature holds.
//
// Four counts take turns: neighbours are often alike, and would wait for each other's sum.
void count_bins(Array<const std::uint8_t, 1> codes, Array<int64_t, 1> out) {
    int64_t counts[4][N_BINS] = {};
    const int64_t whole = codes.size() / 4 * 4;
    for (int64_t n = 0; n < whole; n += 4)
        for (int k = 0; k < 4; ++k) ++counts[k][codes(n + k)];
    for (int64_t n = whole; n < codes.size(); ++n) ++counts[0][codes(n)];
    for (int b = 0; b < N_BINS; ++b)
        out(b) = counts[0][b] + counts[1][b] + counts[2][b] + counts[3][b];
}

// Write each example's cell in the table of several features' coarse bins.
void join_bins(Array<const std::uint8_t, 2> codes, Array<const std::uint8_t, 2> coarse,
               Array<const int64_t, 1> planes, Array<const int64_t, 1> sizes,
               Array<std::uint16_t, 1> out) {
    std::fill(out.begin(), out.end(), 0);
    for (int64_t a = 0; a < planes.size(); ++a) {
        const std::uint8_t *code = &codes(planes(a), 0), *level = &coarse(planes(a), 0);
        for (int64_t n = 0; n < out.size(); ++n)
            out(n) = static_cast<std::uint16_t>(out(n) * sizes(a) + level[code[n]]);
    }
}

// Write the positions whose code is `wanted`; return how many there are.
int64_t bin_members(Array<const std::uint8_t, 1> codes, int64_t wanted,
                    Array<std::int32_t, 1> out) {
    int64_t count = 0;
    for (const std::uint8_t *code = codes.begin(); code != codes.end(); ++code) {
        const void *next = std::memchr(code, static_cast<int>(wanted), codes.end() - code);
        if (next == nullptr) break;
        code = static_cast<const std::uint8_t *>(next);
        out(count++) = static_cast<std::int32_t>(code - codes.begin());
    }
    return count;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("quantise", pgm::variants<Quantise>, "X"_a, "rows"_a, "edges"_a, "start"_a, "stop"_a,
               "codes"_a);
    module.add("count_bins", count_bins, "codes"_a, "out"_a);
    module.add("join_bins", join_bins, "codes"_a, "coarse"_a, "planes"_a, "sizes"_a, "out"_a);
    module.add("bin_members", bin_members, "codes"_a, "wanted"_a, "out"_a);
}
