// The picture that a sweep paints and reads: for each u the first face from the left.
//
// See _sweep_kernels.cpp for what u is. A picture has K bins for each cell of u (K a power of two). A
// bin holds one face, or two with the exact position of the edge between them; where a third would be
// needed it says MIXED, and the few rays that look there are followed cell by cell instead.
//
// Bin b lies in plane b mod K at place b / K. The cell centres of a column all have the same fraction
// of u, so they look into neighbouring places of one plane, and the look-up is a vector operation. The
// pictures of several beams lie one after the other in flat arrays.
//
// Faces are 16-bit numbers: X > 0 for a near side at column X, -1 - Y for a lower side at row Y. A bin
// packs its lower face in the low half of a 32-bit word and its upper face in the high half.

#pragma once

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/sensing/_sweep_tables.hpp"

namespace pgm::sensing {

constexpr std::int32_t MIXED = 0;  // as a near side it would lie behind every viewer: what is read
                                   // off it is negative
constexpr std::int64_t LONG_RUN = 12;   // cells of a near side from which on its planes are filled
                                        // one by one; measured
constexpr double BEFORE_TIE = 1e-9;     // a ray through a corner passes below it: it steps along the
                                        // major axis first

PGM_INLINE std::int32_t lower_face(std::int32_t pair) { return static_cast<std::int16_t>(pair); }
PGM_INLINE std::int32_t upper_face(std::int32_t pair) { return pair >> 16; }
PGM_INLINE std::int32_t pair_of(std::int32_t upper, std::int32_t lower) {
    return static_cast<std::int32_t>((static_cast<std::uint32_t>(upper) << 16) |
                                     (static_cast<std::uint32_t>(lower) & 0xFFFF));
}

// Bring a bin near; a hint, to which places outside the pictures do no harm.
PGM_INLINE void prefetch_bin(const Pictures &pictures, std::int64_t at) {
    __builtin_prefetch(pictures.pairs.data() + at, 1);
    __builtin_prefetch(pictures.edges.data() + at, 1);
}

// Paint a bin from `edge` (0 to 1) to its end.
PGM_INLINE void cover_upper_part(const Pictures &pictures, std::int64_t at, std::int32_t face,
                                 float edge) {
    const std::int32_t pair = pictures.pairs(at);
    const std::int32_t lower = lower_face(pair), upper = upper_face(pair);
    // One face: there is no edge yet.
    const float old_edge = lower == upper ? 2.0f : pictures.edges(at);
    // Painting from above the old edge leaves a stretch of the old upper face in between.
    const std::int32_t kept = (edge > old_edge) & (upper != face) ? MIXED : face;
    pictures.edges(at) = edge < old_edge ? edge : old_edge;
    pictures.pairs(at) = pair_of(kept, lower);
}

// Paint a bin from its beginning to `edge` (0 to 1).
PGM_INLINE void cover_lower_part(const Pictures &pictures, std::int64_t at, std::int32_t face,
                                 float edge) {
    const std::int32_t pair = pictures.pairs(at);
    const std::int32_t lower = lower_face(pair), upper = upper_face(pair);
    const float old_edge = lower == upper ? -1.0f : pictures.edges(at);
    const std::int32_t kept = (edge < old_edge) & (lower != face) ? MIXED : face;
    pictures.edges(at) = edge > old_edge ? edge : old_edge;
    pictures.pairs(at) = pair_of(upper, kept);
}

// Paint a bin from `begin` to `end`, both inside it.
PGM_INLINE void cover_inside(const Pictures &pictures, std::int64_t at, std::int32_t face,
                             float begin, float end) {
    std::int32_t &pair = pictures.pairs(at);
    float &edge = pictures.edges(at);
    const std::int32_t lower = lower_face(pair), upper = upper_face(pair);
    if (lower == upper) {
        if (lower != face) {  // no bin stores the face above `end`: MIXED from `begin` on
            pair = pair_of(MIXED, lower);
            edge = begin;
        }
    } else if (end <= edge) {
        if (lower != face) pair = pair_of(upper, MIXED);
    } else if (lower == face && begin <= edge) {
        edge = end;
    } else if (begin >= edge) {
        if (upper != face) pair = pair_of(MIXED, lower);
    } else if (upper == face) {
        edge = begin;
    } else {
        pair = pair_of(MIXED, MIXED);
    }
}

// Where a border of columns crosses row 0: the bin, its plane, and where in it.
struct Crossing {
    std::int64_t bin, plane;
    float edge;

    PGM_INLINE Crossing(const Rays &rays, std::int64_t beam, std::int64_t map_x,
                        std::int64_t n_bins) {
        const double u =
            (rays.of(beam, SHIFT) - rays.of(beam, SLOPE) * static_cast<double>(map_x)) *
            static_cast<double>(n_bins);
        bin = static_cast<std::int64_t>(u);
        edge = static_cast<float>(u - static_cast<double>(bin));
        plane = bin & (n_bins - 1);
    }
};

// Paint the faces of one column of the region's lists over the pictures of all beams.
//
// It is column `x` of the octant, column `map_x` of the map. Faces are clipped to the bins of
// the picture.
PGM_INLINE void paint_column(const Region &region, std::int64_t column, std::int64_t x,
                             std::int64_t map_x, const Rays &rays, const Pictures &pictures) {
    using std::int64_t;
    std::int32_t *pairs = pictures.pairs.data();
    const auto &near_sides = region.near.entries;
    const auto &lower_sides = region.lower.entries;
    const int64_t n_beams = rays.size(), per_beam = pictures.pairs.size() / n_beams;
    for (int64_t beam = 0; beam < n_beams; ++beam) {
        if (static_cast<double>(x) > rays.of(beam, LAST_COLUMN)) continue;
        const int64_t log_bins = rays.whole(beam, LOG_BINS);
        const int64_t n_places = rays.whole(beam, N_PLACES), n_bins = int64_t(1) << log_bins;
        // Bins and places in them of the corners at row 0: on the column's left border ...
        const Crossing on_left(rays, beam, map_x, n_bins);
        const int64_t lift = (on_left.bin >> log_bins) - rays.whole(beam, LIFT);
        const int64_t origin = beam * per_beam + lift, plane = on_left.plane;
        const int64_t left = origin + plane * n_places;
        // Rows whose corners the picture has.
        const int64_t lowest = 1 - lift, highest = n_places - 2 - lift;
        int64_t first = region.near.starts(column), last = region.near.starts(column + 1);
        while (first < last && near_sides(first, 1) <= lowest) ++first;
        while (first < last && near_sides(last - 1, 0) >= highest) --last;
        for (int64_t k = first; k < last; ++k) {  // fetch all, so that none is waited for alone
            prefetch_bin(pictures, left + near_sides(k, 0));
            prefetch_bin(pictures, left + near_sides(k, 1));
        }
        for (int64_t k = first; k < last; ++k) {
            const int64_t begin = std::max<int64_t>(near_sides(k, 0), lowest);
            const int64_t end = std::min<int64_t>(near_sides(k, 1), highest);
            const auto face = static_cast<std::int32_t>(x);
            const std::int32_t word = pair_of(face, face);
            if (end - begin < LONG_RUN) {
                for (int64_t b = plane + 1; b < plane + (end - begin) * n_bins; ++b)
                    pairs[origin + (b & (n_bins - 1)) * n_places + (b >> log_bins) + begin] = word;
            } else {
                for (int64_t p = 0; p < n_bins; ++p) {
                    // Planes beyond the corner's own begin in the first place, others one later.
                    std::int32_t *row = pairs + origin + p * n_places;
                    std::fill(row + begin + (p <= plane), row + end + (p < plane), word);
                }
            }
            cover_upper_part(pictures, left + begin, face, on_left.edge);
            cover_lower_part(pictures, left + end, face, on_left.edge);
        }
        first = region.lower.starts(column);
        last = region.lower.starts(column + 1);
        while (first < last && lower_sides(first) < lowest) ++first;
        while (first < last && lower_sides(last - 1) > highest) --last;
        if (first == last || rays.of(beam, SLOPE) == 0.0) continue;
        // ... and on its right border.
        const Crossing on_right(rays, beam, map_x + 1, n_bins);
        const int64_t right_place = (on_right.bin >> log_bins) - (on_left.bin >> log_bins);
        const int64_t right = origin + on_right.plane * n_places + right_place;
        for (int64_t k = first; k < last; ++k) {
            prefetch_bin(pictures, right + lower_sides(k));
            prefetch_bin(pictures, left + lower_sides(k));
        }
        for (int64_t k = first; k < last; ++k) {
            const int64_t y = lower_sides(k);
            const auto face = static_cast<std::int32_t>(-1 - y);
            if (on_right.bin < on_left.bin) {
                const std::int32_t word = pair_of(face, face);
                for (int64_t b = on_right.plane + 1;
                     b < on_right.plane + on_left.bin - on_right.bin; ++b) {
                    const int64_t place = right_place + (b >> log_bins) + y;
                    pairs[origin + (b & (n_bins - 1)) * n_places + place] = word;
                }
                cover_upper_part(pictures, right + y, face, on_right.edge);
                cover_lower_part(pictures, left + y, face, on_left.edge);
            } else {
                cover_inside(pictures, right + y, face, on_right.edge, on_left.edge);
            }
        }
    }
}

// Read the ranges of one span of a column off the picture of one beam.
//
// Returns whether a wanted one is not known; it reads negative. Whole blocks are read, so that no
// loop over a rest is needed; the buffers are long enough.
PGM_INLINE bool look_up(const Pictures &pictures, const Column &column, std::int64_t span,
                        std::int64_t beam, std::int64_t x, const Rays &rays) {
    const std::int64_t begin = column.spans(span, 0), end = column.spans(span, 1);
    const std::int64_t stride = column.readings.size() / rays.size();
    const float fraction = column.fractions(beam), cap = rays.cap;
    const auto centre = static_cast<float>(static_cast<double>(x) + 0.5);
    const auto metres_major = static_cast<float>(rays.of(beam, METRES_MAJOR));
    const auto metres_minor = static_cast<float>(rays.of(beam, METRES_MINOR));
    const std::int32_t *__restrict pairs = pictures.pairs.data() + column.starts(beam);
    const float *__restrict edges = pictures.edges.data() + column.starts(beam);
    const float *__restrict rows = column.rows.data();
    const std::int32_t *__restrict nodes = column.nodes.data();
    float *__restrict out = column.readings.data() + beam * stride;
    std::int32_t mixed = 0;
    for (std::int64_t at = begin; at < end; at += BLOCK)
        for (std::int64_t i = at; i < at + BLOCK; ++i) {
            const std::int32_t pair = pairs[i], upper = upper_face(pair), lower = lower_face(pair);
            const std::int32_t face = fraction >= edges[i] ? upper : lower;
            const float to_near = (static_cast<float>(face) - centre) * metres_major;
            const float to_lower = (rows[i] - static_cast<float>(face)) * metres_minor;
            const float reading = face >= 0 ? to_near : to_lower;
            out[i] = reading < cap ? reading : cap;
            mixed |= (nodes[i] >= 0) & (face == MIXED);
        }
    return mixed != 0;
}

// Read the spans of column `x` off the pictures of all beams.
//
// `column.mixed` notes for which beams some reading is not known.
PGM_INLINE void answer_column(const Column &column, std::int64_t n_spans, const Frame &frame,
                              std::int64_t x, const Rays &rays, const Pictures &pictures) {
    const std::int64_t n_beams = rays.size(), per_beam = pictures.pairs.size() / n_beams;
    for (std::int64_t beam = 0; beam < n_beams; ++beam) {
        const std::int64_t log_bins = rays.whole(beam, LOG_BINS);
        const std::int64_t n_bins = std::int64_t(1) << log_bins;
        const double place_x = static_cast<double>(frame.map_column + x) + 0.5;
        const double u = (rays.of(beam, SHIFT) + 0.5 - rays.of(beam, SLOPE) * place_x) *
                         static_cast<double>(n_bins);
        const auto b = static_cast<std::int64_t>(u - BEFORE_TIE);
        column.fractions(beam) = static_cast<float>(u - BEFORE_TIE - static_cast<double>(b));
        const std::int64_t place = (b >> log_bins) - rays.whole(beam, LIFT) + frame.tile_row;
        const std::int64_t plane = (b & (n_bins - 1)) * rays.whole(beam, N_PLACES);
        column.starts(beam) = beam * per_beam + plane + place;
    }
    for (std::int64_t beam = 0; beam < n_beams; ++beam) {
        if (beam + 1 < n_beams)
            for (std::int64_t k = 0; k < n_spans; ++k)
                for (std::int64_t y = column.spans(k, 0); y < column.spans(k, 1); y += 16)
                    prefetch_bin(pictures, column.starts(beam + 1) + y);
        bool mixed = false;
        for (std::int64_t k = 0; k < n_spans; ++k)
            mixed |= look_up(pictures, column, k, beam, x, rays);
        column.mixed(beam) = mixed;
    }
}

}  // namespace pgm::sensing
