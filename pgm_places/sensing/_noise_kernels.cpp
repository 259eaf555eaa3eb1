// Sensor noise as a function of seed, cell and beam: no generator's state, so no order either.

#include <algorithm>
#include <cmath>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/sensing/_dda.hpp"

namespace {

using pgm::Array;
using std::uint32_t;

constexpr double PI = 3.141592653589793;

// A SensorNoise for the kernel, with its seed as two words.
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

// A word as a number in (0, 1), (word + 0.5) / 2^32: exact, by way of a signed word, which vectors
// of any width convert.
PGM_INLINE double uniform(uint32_t word) {
    return (static_cast<std::int32_t>(word ^ 0x80000000u) + 2147483648.5) / 4294967296.0;
}

// How many words are below a probability as such numbers: they compare without branches.
PGM_INLINE std::int64_t words_below(double probability) {
    return static_cast<std::int64_t>(std::ceil(std::min(probability, 1.0) * 4294967296.0 - 0.5));
}

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
                const auto n = std::min(BEAMS, n_beams - first);
                const Words words{key_a, key_b, static_cast<uint32_t>(4 * first)};
                if (noise.sigma_m > 0.0)
                    for_words<true>(scan + first, n, words, noise);
                else
                    for_words<false>(scan + first, n, words, noise);
            }
        }
    }

    // Four words for each beam, one behind the other, from a counter on.
    struct Words {
        uint32_t key_a, key_b, counter;
        PGM_INLINE void draw(int which, uint32_t *words) const {
            for (uint32_t k = 0; k < BEAMS; ++k)
                words[k] = word_drawn(key_a, key_b, counter + 4 * k + which);
        }
    };

    // Disturb n readings; words that make no difference are not drawn.
    template <bool GAUSSIAN>
    static PGM_INLINE void for_words(float *scan, std::int64_t n, Words words, const Noise &noise) {
        uint32_t kinds[BEAMS], anywhere[BEAMS], radii[BEAMS], turns[BEAMS];
        words.draw(0, kinds);
        words.draw(1, anywhere);
        if constexpr (GAUSSIAN) {
            words.draw(2, radii);
            words.draw(3, turns);
        }
        const auto top = static_cast<float>(noise.max_range_m);
        const std::int64_t at_top = words_below(noise.p_max);
        const std::int64_t replaced = words_below(noise.p_max + noise.p_random);
        if constexpr (GAUSSIAN)
            for (std::int64_t k = 0; k < n; ++k)
                if (scan[k] < top && kinds[k] >= replaced)
                    scan[k] = noisy(scan[k], radii[k], turns[k], noise);
        for (std::int64_t k = 0; k < n; ++k) {
            const auto random = static_cast<float>(uniform(anywhere[k]) * noise.max_range_m);
            const float within = random < top ? random : top;
            const float other = kinds[k] < at_top ? top : within;
            scan[k] = kinds[k] < replaced ? other : scan[k];
        }
    }

    // A reading with gaussian noise, from two uniform numbers by Box and Muller's transform.
    static PGM_INLINE float noisy(float reading, uint32_t a, uint32_t b, const Noise &noise) {
        const double radius = std::sqrt(-2.0 * std::log(uniform(a)));
        const double turn = 2.0 * PI * uniform(b);
        const auto moved = static_cast<float>(reading + noise.sigma_m * radius * std::cos(turn));
        return std::min(std::max(moved, 0.0f), static_cast<float>(noise.max_range_m));
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
