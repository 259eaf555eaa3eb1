// Sensor noise as a function of seed, cell and beam: no generator's state, so no order either.

#include <algorithm>
#include <cmath>

#include "pgm_places/kernels/lanes.hpp"
#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/sensing/_dda.hpp"

namespace {

using pgm::Array;
using std::uint32_t;

constexpr double PI = 3.141592653589793;

// A SensorNoise as the kernel takes it, its seed as two words.
struct Noise {
    std::int64_t seed_low, seed_high;
    double sigma_m, p_random, p_max, max_range_m;
    auto fields() { return std::tie(seed_low, seed_high, sigma_m, p_random, p_max, max_range_m); }
};

// A bijection of words whose output bits all depend on all input bits (C. Wellons).
PGM_INLINE uint32_t mixed(uint32_t word) {
    word ^= word >> 16;
    word *= 0x21F0AAADu;
    word ^= word >> 15;
    word *= 0x735A2D97u;
    return word ^ (word >> 15);
}

// The counter-th number that is drawn under a key of two words, in (0, 1).
PGM_INLINE double uniform_draw(uint32_t key_a, uint32_t key_b, uint32_t counter) {
    return (mixed(mixed(counter * 0x9E3779B9u + key_a) + key_b) + 0.5) / 4294967296.0;
}

// What the numbers of a cell are drawn by.
struct Key {
    uint32_t a, b;

    PGM_INLINE Key(const Noise &noise, uint32_t row, uint32_t column) {
        a = mixed(mixed(mixed(static_cast<uint32_t>(noise.seed_low)) ^ row) ^ column);
        const uint32_t high = static_cast<uint32_t>(noise.seed_high) ^ 0x5BD1E995u;
        b = mixed(mixed(mixed(high) + column) + row);
    }

    PGM_INLINE double uniform(uint32_t counter) const { return uniform_draw(a, b, counter); }
};

// Disturb the scans of the cells, which are the rows `cells.nodes` of `ranges`.
struct AddNoise {
    template <int BYTES>
    static PGM_INLINE void run(Array<float, 2> ranges, pgm::sensing::Cells cells, Noise noise) {
        const float top = static_cast<float>(noise.max_range_m);
        for (std::int64_t i = 0; i < cells.rows.size(); ++i) {
            const Key key(noise, static_cast<uint32_t>(cells.rows(i)),
                          static_cast<uint32_t>(cells.columns(i)));
            float *scan = &ranges(cells.nodes(i), 0);
            for (std::int64_t beam = 0; beam < ranges.shape(1); ++beam)
                disturb(scan[beam], key, static_cast<uint32_t>(4 * beam), noise, top);
        }
    }

    // Disturb a reading by the numbers from the `draw`-th on.
    static PGM_INLINE void disturb(float &reading, const Key &key, uint32_t draw,
                                   const Noise &noise, float top) {
        const double kind = key.uniform(draw);
        if (kind < noise.p_max) {
            reading = top;
        } else if (kind < noise.p_max + noise.p_random) {
            const auto drawn = static_cast<float>(key.uniform(draw + 1) * noise.max_range_m);
            reading = std::min(drawn, top);
        } else if (noise.sigma_m > 0.0 && reading < top) {
            // Box and Muller's transform of two uniform numbers to a gaussian one.
            const double radius = std::sqrt(-2.0 * std::log(key.uniform(draw + 2)));
            const double turn = 2.0 * PI * key.uniform(draw + 3);
            const auto noisy = static_cast<float>(reading + noise.sigma_m * radius * std::cos(turn));
            reading = std::min(std::max(noisy, 0.0f), top);
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("add_noise", pgm::variants<AddNoise>, "ranges"_a, "cells"_a, "noise"_a);
    module.add("uniform_draw", [](uint32_t a, uint32_t b, uint32_t n) { return uniform_draw(a, b, n); }, "key_a"_a, "key_b"_a, "counter"_a);
}
