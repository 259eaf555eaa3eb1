// Exact Euclidean distances on a raster: along the columns, then along the rows.
//
// The second pass takes each run of cells between two targets by itself, since a target at its end is
// nearer than anything behind it. Short distances are found by comparing cells ever farther apart, many
// at once; long ones by the lower envelope of parabolas (Meijster, Roerdink and Hesselink, 2000), whose
// time does not grow with them.

#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

constexpr int64_t NEAR = 64;  // up to so many cells, comparing is faster than the envelope

PGM_INLINE int64_t floor_of_ratio(int64_t above, int64_t below) {  // `below` is positive
    const int64_t ratio = above / below;
    return ratio - (above % below < 0);
}

// The distance to the nearest target of the same column.
PGM_INLINE void column_distance(const Array<const bool, 2> &is_target,
                                const Array<int32_t, 2> &squared) {
    const int64_t height = is_target.shape(0), width = is_target.shape(1);
    for (int64_t r = 0; r < height; ++r) {
        const bool *target = &is_target(r, 0);
        int32_t *here = &squared(r, 0);
        const int32_t *before = r > 0 ? &squared(r - 1, 0) : nullptr;
        for (int64_t c = 0; c < width; ++c)
            here[c] = target[c] ? 0 : r > 0 ? before[c] + 1 : 1;
    }
    for (int64_t c = 0; c < width; ++c) squared(height - 1, c) = is_target(height - 1, c) ? 0 : 1;
    for (int64_t r = height - 2; r >= 0; --r) {
        int32_t *here = &squared(r, 0);
        const int32_t *after = &squared(r + 1, 0);
        for (int64_t c = 0; c < width; ++c) here[c] = std::min(here[c], after[c] + 1);
    }
}

// What a row is worked on with, (W,) each.
struct Scratch {
    int32_t *near, *site, *start;
    int64_t *row;
};

// The smaller of `squared` and, over the run, `row` plus the squared distance to it.
PGM_INLINE void lowest_parabolas(int32_t *squared, int64_t begin, int64_t end, const Scratch &room) {
    const auto &[near, site, start, row] = room;
    int64_t last = -1;
    for (int64_t c = begin; c < end; ++c) {
        // Parabolas that lie above the new one from their start on are never the lowest.
        int64_t first = begin;
        for (; last >= 0; --last) {
            const int64_t s = site[last], here = start[last] - s, there = start[last] - c;
            if (here * here + row[s] <= there * there + row[c]) {
                first = 1 + floor_of_ratio(c * c - s * s + row[c] - row[s], 2 * (c - s));
                break;
            }
        }
        if (first < end) {
            ++last;
            site[last] = static_cast<int32_t>(c);
            start[last] = static_cast<int32_t>(std::max(first, begin));
        }
    }
    for (int64_t c = end - 1; c >= begin; --c) {
        const int64_t s = site[last];
        squared[c] =
            static_cast<int32_t>(std::min<int64_t>(squared[c], (c - s) * (c - s) + row[s]));
        if (c == start[last]) --last;
    }
}

// Turn a row's distances along columns into squared ones, from `begin` to before `end`.
//
// The cells at both ends of the run are targets.
PGM_INLINE void along_run(int32_t *squared, int64_t begin, int64_t end, const Scratch &room) {
    int64_t farthest = 0;
    for (int64_t c = begin; c < end; ++c) {
        const int64_t outside = std::min(c - begin + 1, end - c);
        const int64_t up = squared[c], away = std::min(up, outside);
        farthest = std::max(farthest, away);
        room.row[c] = up * up;
        squared[c] = static_cast<int32_t>(away * away);
    }
    if (farthest > NEAR) {
        lowest_parabolas(squared, begin, end, room);
        return;
    }
    int32_t *__restrict near = room.near;
    for (int64_t c = begin; c < end; ++c)
        near[c] = static_cast<int32_t>(std::min(room.row[c], NEAR * NEAR));
    // A cell k columns away counts only where k is less than the distance so far, thus in the run.
    for (int64_t k = 1; k < farthest; ++k) {
        int32_t *__restrict middle = squared;
        const auto further = static_cast<int32_t>(k * k);
        for (int64_t c = begin + k; c < end - k; ++c)
            middle[c] = std::min(middle[c], std::min(near[c - k], near[c + k]) + further);
    }
}

// Squared distance in cells from each cell's centre to the nearest target cell's centre.
//
// Cells outside the raster are targets too. `site`, `start` and `row` are scratch (W,).
struct SquaredDistance {
    template <int BYTES>
    static PGM_INLINE void run(Array<const bool, 2> is_target, Array<int32_t, 2> squared,
                               Array<int32_t, 1> site, Array<int32_t, 1> start,
                               Array<int64_t, 1> row) {
        const int64_t height = is_target.shape(0), width = is_target.shape(1);
        std::vector<int32_t> near(width);
        const Scratch room = {near.data(), site.data(), start.data(), row.data()};
        column_distance(is_target, squared);
        for (int64_t r = 0; r < height; ++r) {
            int32_t *here = &squared(r, 0);
            for (int64_t end = 0; end < width;) {
                int64_t begin = end;
                while (begin < width && here[begin] == 0) ++begin;
                end = begin;
                while (end < width && here[end] != 0) ++end;
                if (begin < end) along_run(here, begin, end, room);
            }
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("squared_distance", pgm::variants<SquaredDistance>, "is_target"_a, "squared"_a,
               "site"_a, "start"_a, "row"_a);
}
