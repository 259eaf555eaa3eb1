// Scans carried into planes of sixteen lanes, and features back into rows.

#include "pgm_places/features/_tiles.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using namespace pgm::features;
using pgm::Array;
using std::int64_t;

// Write scans `first..last - 1` to planes; a beam without a return becomes `limit`.
//
// The last scan is repeated in the lanes that remain of the last tile.
template <class T> struct LoadTiles {
    template <int BYTES>
    static PGM_INLINE void run(Array<const T, 2> ranges, int64_t first, int64_t last, double limit,
                               Array<double, 2> rho) {
        const int64_t n_tiles = (last - first + LANES - 1) / LANES;
        for (int64_t tile = 0; tile < n_tiles; ++tile) {
            const T *scans[LANES];
            for (int lane = 0; lane < LANES; ++lane)
                scans[lane] = &ranges(std::min(first + tile * LANES + lane, last - 1), 0);
            double *plane = &rho(tile * TILE_ROWS, 0);
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                using L = pgm::Simd<double, LANES, BYTES>;
                const L length = L::every([&](int lane) PGM_INLINE_LAMBDA {
                    return static_cast<double>(scans[lane][beam]);
                });
                const auto returned = (length >= 0.0) & (length < limit);  // false for NaN
                select(returned, length, L::splat(limit)).store(plane + beam * LANES);
            }
            std::copy(plane, plane + LANES, plane + N_BEAMS * LANES);
        }
    }
};

// Write feature `columns[c]` of scans `first..last - 1` to column `c` of their rows.
void write_rows(Array<const float, 2> values, Array<const int64_t, 1> columns, int64_t first,
                int64_t last, Array<float, 2> out) {
    const int64_t n_columns = columns.size();
    for (int64_t start = first; start < last; start += LANES) {
        const float *tile = &values((start - first) / LANES * N_FEATURES, 0);
        const int64_t n_scans = std::min<int64_t>(LANES, last - start);
        for (int64_t c = 0; c < n_columns; c += LANES)
            for (int64_t lane = 0; lane < n_scans; ++lane)
                for (int64_t k = c; k < std::min(c + LANES, n_columns); ++k)
                    out(start + lane, k) = tile[columns(k) * LANES + lane];
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("load_tiles", pgm::variants<LoadTiles<float>>, "ranges"_a, "first"_a, "last"_a,
               "limit"_a, "rho"_a);
    module.add("load_tiles", pgm::variants<LoadTiles<double>>, "ranges"_a, "first"_a, "last"_a,
               "limit"_a, "rho"_a);
    module.add("write_rows", write_rows, "values"_a, "columns"_a, "first"_a, "last"_a, "out"_a);
}
