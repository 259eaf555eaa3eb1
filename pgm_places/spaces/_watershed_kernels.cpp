// Basins of a relief: every cell belongs to the summit that steepest ascent leads to.
//
// All rasters are flat with a frame of one cell around the map, so that the neighbours of a cell are at
// fixed offsets. Every rule depends on values only, never on the order of cells, so that rotating the
// map by a right angle or mirroring it leaves its basins the same.

#include <nanobind/stl/tuple.h>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;
using std::uint8_t;

constexpr int32_t PARTED = 2147483647;  // the basin of a cell whose steepest ascents lead to
                                        // indistinguishable summits
constexpr int N_SIDES = 4;              // the first four neighbours share a side, the others a corner
constexpr int64_t SIDE_WEIGHT = 181, CORNER_WEIGHT = 128;  // a slope is a rise over 1 or over the
                                                           // root of 2

using Relief = Array<const int32_t, 1>;
using Steps = Array<const int64_t, 1>;

// Write the steepest ascents from each cell, one bit per neighbour; none on flat ground.
//
// Sides win ties against corners.
void steepest_ways(Relief relief, Steps steps, Array<uint8_t, 1> ways) {
    const int64_t width = -steps(0);
    for (int64_t i = width; i < relief.size() - width; ++i) {
        const int64_t own = relief(i);
        int64_t best = 0;
        unsigned found = 0;
        if (own != 0) {
            for (int k = 0; k < N_SIDES; ++k) {
                const int64_t slope = (relief(i + steps(k)) - own) * SIDE_WEIGHT;
                if (slope > best) {
                    best = slope;
                    found = 1u << k;
                } else if (slope == best && best > 0) {
                    found |= 1u << k;
                }
            }
            for (int k = N_SIDES; k < 8; ++k) {
                const int64_t slope = (relief(i + steps(k)) - own) * CORNER_WEIGHT;
                if (slope > best) {
                    best = slope;
                    found = 1u << k;
                } else if (slope == best && found >= 1u << N_SIDES) {
                    found |= 1u << k;
                }
            }
        }
        ways(i) = static_cast<uint8_t>(found);
    }
}

// The neighbours on the same plateau that the previous wave reached, sides first.
uint8_t ways_back(const Relief &relief, const Steps &steps, const Array<int32_t, 1> &basin,
                  const Array<uint8_t, 1> &ways, int64_t i, int32_t wave) {
    unsigned found = 0;
    for (int k = 0; k < 8; ++k) {
        if (k == N_SIDES && found) break;
        const int64_t j = i + steps(k);
        if (relief(j) == relief(i) && ways(j) != 0 && basin(j) == wave + 1) found |= 1u << k;
    }
    return static_cast<uint8_t>(found);
}

// Point the cells of plateaus that have an ascent towards their nearest cells that ascend.
//
// Waves run inward from cells that ascend. `basin` is -1 on entry, and less than -1 on return wherever
// a wave has passed; `queue` is scratch with one entry per cell.
void cross_plateaus(Relief relief, Steps steps, Array<uint8_t, 1> ways, Array<int32_t, 1> basin,
                    Array<int32_t, 1> queue) {
    const int64_t width = -steps(0);
    int64_t end = 0;
    for (int64_t i = width; i < relief.size() - width; ++i) {
        if (relief(i) == 0 || ways(i) != 0) continue;
        for (int k = 0; k < 8; ++k) {
            const int64_t j = i + steps(k);
            if (relief(j) == relief(i) && ways(j) != 0) {
                queue(end++) = static_cast<int32_t>(i);
                basin(i) = -2;
                break;
            }
        }
    }
    int32_t wave = -2;
    for (int64_t begin = 0; begin < end; --wave) {
        const int64_t last = end;
        for (int64_t q = begin; q < last; ++q)
            ways(queue(q)) = ways_back(relief, steps, basin, ways, queue(q), wave);
        for (int64_t q = begin; q < last; ++q) {
            const int64_t i = queue(q);
            for (int k = 0; k < 8; ++k) {
                const int64_t j = i + steps(k);
                if (relief(j) == relief(i) && ways(j) == 0 && basin(j) == -1) {
                    basin(j) = wave - 1;
                    queue(end++) = static_cast<int32_t>(j);
                }
            }
        }
        begin = last;
    }
}

// The number B of summits; writes the rank of each: by height, then by the size of the plateau.
//
// Summits are plateaus without an ascent, numbered in the order of their first cells; their basins
// are written. No two touch, so that there is at most one for four cells.
int64_t number_summits(Relief relief, Steps steps, Array<const uint8_t, 1> ways,
                       Array<int32_t, 1> basin, Array<int32_t, 1> stack, Array<int64_t, 1> rank) {
    const int64_t width = -steps(0);
    int32_t count = 0;
    for (int64_t i = width; i < relief.size() - width; ++i) {
        if (relief(i) == 0 || ways(i) != 0 || basin(i) >= 0) continue;
        basin(i) = count;
        stack(0) = static_cast<int32_t>(i);
        int64_t top = 1, size = 0;
        while (top > 0) {
            const int64_t at = stack(--top);
            ++size;
            for (int k = 0; k < 8; ++k) {
                const int64_t j = at + steps(k);
                if (relief(j) == relief(at) && basin(j) < 0) {
                    basin(j) = count;
                    stack(top++) = static_cast<int32_t>(j);
                }
            }
        }
        rank(count++) = (static_cast<int64_t>(relief(i)) << 32) + size;
    }
    return count;
}

// Write the basin of every cell; returns the number of PARTED cells.
//
// If ascents lead to several basins, the cell goes to the one with the highest rank.
int64_t climb(Relief relief, Steps steps, Array<const uint8_t, 1> ways,
              Array<const int64_t, 1> rank, Array<int32_t, 1> basin, Array<int32_t, 1> stack) {
    const int64_t width = -steps(0);
    int64_t n_parted = 0;
    for (int64_t start = width; start < relief.size() - width; ++start) {
        if (relief(start) == 0 || basin(start) >= 0) continue;
        stack(0) = static_cast<int32_t>(start);
        int64_t top = 1;
        while (top > 0) {
            const int64_t i = stack(top - 1);
            int32_t own = -1;
            bool tied = false, waiting = false;
            unsigned left = ways(i);
            for (int k = 0; left != 0; ++k, left >>= 1) {
                if (!(left & 1)) continue;
                const int32_t found = basin(i + steps(k));
                if (found < 0) {
                    stack(top++) = static_cast<int32_t>(i + steps(k));
                    waiting = true;
                    break;
                }
                if (own < 0 || own == PARTED) {
                    own = found;
                } else if (found != own && found != PARTED) {
                    if (rank(found) > rank(own)) {
                        own = found;
                        tied = false;
                    } else if (rank(found) == rank(own)) {
                        tied = true;
                    }
                }
            }
            if (waiting) continue;
            --top;
            basin(i) = tied ? PARTED : own;
            n_parted += basin(i) == PARTED;
        }
    }
    return n_parted;
}

// Number the lines that PARTED cells form, from `count` on.
//
// Returns the number of lines, and the number of pairs (line, adjacent basin) with repetitions, which
// are the first rows of `beside` (8 for every PARTED cell, 2).
std::tuple<int64_t, int64_t> number_lines(Array<int32_t, 1> basin, Steps steps, int64_t count,
                                          Array<int32_t, 1> stack, Array<int64_t, 2> beside) {
    const int64_t width = -steps(0);
    int64_t n_pairs = 0, n_lines = 0;
    for (int64_t i = width; i < basin.size() - width; ++i) {
        if (basin(i) != PARTED) continue;
        const auto line = static_cast<int32_t>(count + n_lines++);
        basin(i) = line;
        stack(0) = static_cast<int32_t>(i);
        int64_t top = 1;
        while (top > 0) {
            const int64_t at = stack(--top);
            for (int k = 0; k < 8; ++k) {
                const int64_t j = at + steps(k);
                if (basin(j) == PARTED) {
                    basin(j) = line;
                    stack(top++) = static_cast<int32_t>(j);
                } else if (0 <= basin(j) && basin(j) < count) {
                    beside(n_pairs, 0) = line;
                    beside(n_pairs, 1) = basin(j);
                    ++n_pairs;
                }
            }
        }
    }
    return {n_lines, n_pairs};
}

// The number of cells (B,) and the summed heights (B,) of the basins; all 0 on entry.
void areas_and_volumes(Array<const int32_t, 1> basin, Relief relief, Array<int64_t, 1> area,
                       Array<int64_t, 1> volume) {
    for (int64_t i = 0; i < basin.size(); ++i) {
        if (!(0 <= basin(i) && basin(i) < area.size())) continue;
        area(basin(i)) += 1;
        volume(basin(i)) += relief(i);
    }
}

// Replace every number of a raster except -1.
void renumber(Array<int32_t, 1> basin, Array<const int32_t, 1> number) {
    for (int32_t &own : basin)
        if (own >= 0) own = number(own);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("steepest_ways", steepest_ways, "relief"_a, "steps"_a, "ways"_a);
    module.add("cross_plateaus", cross_plateaus, "relief"_a, "steps"_a, "ways"_a, "basin"_a,
               "queue"_a);
    module.add("number_summits", number_summits, "relief"_a, "steps"_a, "ways"_a, "basin"_a,
               "stack"_a, "rank"_a);
    module.add("climb", climb, "relief"_a, "steps"_a, "ways"_a, "rank"_a, "basin"_a, "stack"_a);
    module.add("number_lines", number_lines, "basin"_a, "steps"_a, "count"_a, "stack"_a,
               "beside"_a);
    module.add("areas_and_volumes", areas_and_volumes, "basin"_a, "relief"_a, "area"_a, "volume"_a);
    module.add("renumber", renumber, "basin"_a, "number"_a);
}
