// What a sweep reads and writes; _sweep.py says what each field means.

#pragma once

#include "pgm_places/kernels/array.hpp"

namespace pgm::sensing {

constexpr std::int64_t BLOCK = 32;  // cells looked up at a time; buffers are padded by as many

// The fields of a beam.
enum Field {
    SLOPE,
    LOG_BINS,
    SHIFT,
    LIFT,
    N_PLACES,
    LAST_COLUMN,
    METRES_MAJOR,
    METRES_MINOR,
    STEP_X,
    STEP_Y,
    PER_X,
    PER_Y,
    METRES_X,
    METRES_Y
};

template <int N> struct Listed {
    Array<const std::int64_t, 1> starts;
    Array<const std::int32_t, N> entries;
    auto fields() { return std::tie(starts, entries); }
};

struct Region {
    Array<const std::uint8_t, 2> blocked;
    Listed<2> near;
    Listed<1> lower;
    auto fields() { return std::tie(blocked, near, lower); }
};

struct TileCells {
    Array<const std::int32_t, 2> nodes;
    Listed<2> runs;
    auto fields() { return std::tie(nodes, runs); }
};

struct Frame {
    bool x_is_major, backward, downward;
    std::int64_t tile_column, tile_row, map_column;
    auto fields() {
        return std::tie(x_is_major, backward, downward, tile_column, tile_row, map_column);
    }
};

struct Rays {
    Array<const double, 2> beams;
    double limit;
    float cap;
    auto fields() { return std::tie(beams, limit, cap); }

    double of(std::int64_t beam, Field field) const { return beams(beam, field); }
    std::int64_t whole(std::int64_t beam, Field field) const {
        return static_cast<std::int64_t>(beams(beam, field));
    }
    std::int64_t size() const { return beams.shape(0); }
};

struct Pictures {
    Array<std::int32_t, 1> pairs;
    Array<float, 1> edges;
    auto fields() { return std::tie(pairs, edges); }
};

struct Column {
    Array<const float, 1> rows;
    Array<std::int32_t, 1> nodes, cells;
    Array<std::int32_t, 2> spans;
    Array<float, 1> readings;
    Array<std::int64_t, 1> starts;
    Array<float, 1> fractions;
    Array<bool, 1> mixed;
    auto fields() {
        return std::tie(rows, nodes, cells, spans, readings, starts, fractions, mixed);
    }
};

struct Output {
    Array<float, 1> ranges;
    std::int64_t first_beam, n_all;
    auto fields() { return std::tie(ranges, first_beam, n_all); }
};

}  // namespace pgm::sensing
