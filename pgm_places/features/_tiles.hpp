// How sixteen scans, a tile, lie in the planes that the kernels share.
//
// A kernel handles a part of a tile at a time: as many scans as two registers hold in float64. Lanes
// never mix, so that the bits do not depend on how many these are.

#pragma once

#include "pgm_places/kernels/array.hpp"
#include "pgm_places/kernels/simd.hpp"

namespace pgm::features {

constexpr int LANES = 16, N_BEAMS = 360, N_FEATURES = 321;
constexpr int TILE_ROWS = N_BEAMS + 1;  // row TILE_ROWS tile + k holds beam k of a tile's scans, one
                                        // a lane; beam 360 is beam 0

// Rows that a tile has in `shape`: float64 results that later kernels need.
enum Shape { AREA, PERIMETER, CENTRE_X, CENTRE_Y, SHAPE_ROWS };

constexpr int F2 = 0, F8 = 12, F27 = 74, F28 = 76, F32 = 78, F5 = 99, F9 = 102, F29 = 104, F31 = 106,
              F17 = 306, F21 = 312;  // first columns, by the table in laser.py

template <int BYTES> constexpr int PART = BYTES / 4;
// The registers of kernels that compare much: of 64 bytes, GCC compares number after number.
template <int BYTES> constexpr int COMPARING = std::min(BYTES, 32);
template <int BYTES> using Wide = Simd<double, PART<BYTES>, BYTES>;
template <int BYTES> using Narrow = Simd<float, PART<BYTES>, BYTES>;

// Some lanes of the rows of a plane: the lanes of a part, or all of its memory as shorter rows.
template <class L, class T> struct Rows {
    T *data;
    int stride;

    PGM_INLINE L load(std::int64_t row) const { return L::load(data + row * stride); }
    PGM_INLINE void store(std::int64_t row, L value) const { value.store(data + row * stride); }
    PGM_INLINE void add(std::int64_t row, L value) const { store(row, load(row) + value); }
};

// The lanes `lane..` of the planes' rows from `first` on.
template <class L, class T>
PGM_INLINE Rows<L, T> part_of(const Array<T, 2> &planes, std::int64_t first, int lane) {
    return {planes.data() + first * LANES + lane, LANES};
}

// The memory of planes as rows of as many lanes as a part has: not all of it is in use.
template <class L, class T> PGM_INLINE Rows<L, T> room_in(const Array<T, 2> &planes) {
    return {planes.data(), sizeof(L) / sizeof(T)};
}

// Where the features of some scans of a tile go.
template <int BYTES> struct Values {
    Rows<Narrow<BYTES>, float> rows;

    PGM_INLINE Values(const Array<float, 2> &values, std::int64_t tile, int lane)
        : rows(part_of<Narrow<BYTES>>(values, tile * N_FEATURES, lane)) {}
    PGM_INLINE void store(std::int64_t column, Wide<BYTES> value) const {
        rows.store(column, narrow(value));
    }
};

// Call `work(tile, lane)` for every part of every tile.
template <int BYTES, class Work> PGM_INLINE void for_each_part(std::int64_t n_tiles, Work work) {
    for (std::int64_t tile = 0; tile < n_tiles; ++tile)
        for (int lane = 0; lane < LANES; lane += PART<BYTES>) work(tile, lane);
}

}  // namespace pgm::features
