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

// The counter-th word that is drawn under a key of two words.
PGM_INLINE uint32_t word_drawn(uint32_t key_a, uint32_t key_b, uint32_t counter) {
    return mixed(mixed(counter * 0x9E3779B9u + key_a) + key_b);
}

// A word as a number in (0, 1).
PGM_INLINE double uniform(uint32_t word) { return (word + 0.5) / 4294967296.0; }

// Disturb the scans of the cells, which are the rows `cells.nodes` of `ranges`.
struct AddNoise {
    static constexpr std::int64_t BEAMS = 32;  // whose words are drawn at a time, by vectors

    template <int BYTES>
    static PGM_INLINE void run(Array<float, 2> ranges, pgm::sensing::Cells cells, Noise noise) {
        const std::int64_t n_beams = ranges.shape(1);
        for (std::int64_t i = 0; i < cells.rows.size(); ++i) {
            const auto row = static_cast<uint32_t>(cells.rows(i));
            const auto column = static_cast<uint32_t>(cells.columns(i));
            const uint32_t low = static_cast<uint32_t>(noise.seed_low);
            const uint32_t high = static_cast<uint32_t>(noise.seed_high) ^ 0x5BD1E995u;
            const uint32_t key_a = mixed(mixed(mixed(low) ^ row) ^ column);
            const uint32_t key_b = mixed(mixed(mixed(high) + column) + row);
            float *scan = &ranges(cells.nodes(i), 0);
            for (std::int64_t first = 0; first < n_beams; first += BEAMS) {
                uint32_t drawn[4 * BEAMS];  // of each beam four, one behind the other
                for (uint32_t k = 0; k < 4 * BEAMS; ++k)
                    drawn[k] = word_drawn(key_a, key_b, static_cast<uint32_t>(4 * first) + k);
                for (std::int64_t k = 0; k < BEAMS && first + k < n_beams; ++k)
                    scan[first + k] = disturbed(scan[first + k], drawn + 4 * k, noise);
            }
        }
    }

    // A reading with the noise that four words make.
    static PGM_INLINE float disturbed(float reading, const uint32_t *drawn, const Noise &noise) {
        const auto top = static_cast<float>(noise.max_range_m);
        const double kind = uniform(drawn[0]);
        if (kind < noise.p_max) return top;
        if (kind < noise.p_max + noise.p_random)
            return std::min(static_cast<float>(uniform(drawn[1]) * noise.max_range_m), top);
        if (!(noise.sigma_m > 0.0 && reading < top)) return reading;
        // Box and Muller's transform of two uniform numbers to a gaussian one.
        const double radius = std::sqrt(-2.0 * std::log(uniform(drawn[2])));
        const double turn = 2.0 * PI * uniform(drawn[3]);
        const auto noisy = static_cast<float>(reading + noise.sigma_m * radius * std::cos(turn));
        return std::min(std::max(noisy, 0.0f), top);
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("add_noise", pgm::variants<AddNoise>, "ranges"_a, "cells"_a, "noise"_a);
    module.add(
        "uniform_draw",
        [](uint32_t a, uint32_t b, uint32_t n) { return uniform(word_drawn(a, b, n)); }, "key_a"_a,
        "key_b"_a, "counter"_a);
}
