// The exact search for a stump: fine histograms, bounds inside bins, the first best split.
//
// The score of a split is the signed mass on its left, twice, less the whole signed mass; that is r
// of a stump that says +1 on the left, times the plain mass. Inside a bin the score can rise by at
// most twice the bin's positive mass, and fall by at most twice its negative mass.

#include <algorithm>
#include <cmath>
#include <limits>

#include <nanobind/stl/tuple.h>

#include "models/weighted_examples.hpp"
#include "pgm_places/kernels/simd.hpp"

namespace {

using pgm::Array;
using pgm::Histograms;
using pgm::Weights;
using std::int64_t;

constexpr int N_BINS = 256;
constexpr int GROUP = 4;  // histograms filled together, to hide the latency of each
constexpr double INFINITE = std::numeric_limits<double>::infinity();

// The masses in the lower bins of a feature.
struct Left {
    int64_t signed_mass = 0, mass = 0;

    void add(int64_t positive, int64_t negative) {
        signed_mass += positive + negative;
        mass += positive - negative;
    }
    // Whether there is mass on both sides.
    bool splits(const Weights &weighed) const { return 0 < mass && mass < weighed.mass(); }
    int64_t score(const Weights &weighed) const { return 2 * signed_mass - weighed.total(); }
};

// Fill the fine histograms of four features, and find their best split at an edge.
void score_bins(Array<const std::uint8_t, 2> codes, Array<const int64_t, 1> planes, Weights weighed,
                Histograms fine, Array<int64_t, 1> best_edge) {
    int64_t tables[2][GROUP][N_BINS] = {};
    const std::uint8_t *code[GROUP];
    for (int a = 0; a < GROUP; ++a) code[a] = &codes(planes(a), 0);
    for (int64_t s = 0; s < weighed.segments.shape(0); ++s) {
        auto &table = tables[weighed.segments(s, 2)];
        for (int64_t n = weighed.segments(s, 0); n < weighed.segments(s, 1); ++n) {
            const int64_t mass = weighed.masses(n);
            for (int a = 0; a < GROUP; ++a) table[a][code[a][n]] += mass;
        }
    }
    for (int a = 0; a < GROUP; ++a) {
        std::copy_n(tables[1][a], N_BINS, &fine.positive(planes(a), 0));
        std::copy_n(tables[0][a], N_BINS, &fine.negative(planes(a), 0));
        Left left;
        int64_t edge = -1;
        for (int b = 0; b < N_BINS; ++b) {
            left.add(tables[1][a][b], tables[0][a][b]);
            if (left.splits(weighed)) edge = std::max(edge, std::abs(left.score(weighed)));
        }
        best_edge(planes(a)) = edge;
    }
}

// List the fine bins whose bound reaches `floor`; return how many there are.
//
// Rows of `out` are (bound, feature, bin, signed mass of lower bins, mass of lower bins).
int64_t promising_bins(Array<const int64_t, 1> planes, Histograms fine, Array<const bool, 2> pure,
                       int64_t total, int64_t floor, Array<int64_t, 2> out) {
    int64_t count = 0;
    for (int64_t j : planes) {
        Left left;
        for (int b = 0; b < N_BINS; ++b) {
            const int64_t p = fine.positive(j, b), q = fine.negative(j, b);
            const int64_t bound = std::max(std::abs(2 * (left.signed_mass + p) - total),
                                           std::abs(2 * (left.signed_mass + q) - total));
            if (bound >= floor && p != q && !pure(j, b)) {
                if (count < out.shape(0)) {
                    const int64_t row[] = {bound, j, b, left.signed_mass, left.mass};
                    std::copy_n(row, 5, &out(count, 0));
                }
                ++count;
            }
            left.add(p, q);
        }
    }
    return count;
}

// The feature, the last bin on the left and the score of the first edge whose score reaches `floor`.
//
// First in the order of `planes`, then of thresholds; (-1, -1, 0) if there is none.
std::tuple<int64_t, int64_t, int64_t> first_good_edge(Array<const int64_t, 1> planes,
                                                      Histograms fine, Weights weighed,
                                                      int64_t floor) {
    for (int64_t j : planes) {
        Left left;
        for (int b = 0; b < N_BINS; ++b) {
            left.add(fine.positive(j, b), fine.negative(j, b));
            if (left.splits(weighed) && std::abs(left.score(weighed)) >= floor)
                return {j, b, left.score(weighed)};
        }
    }
    return {-1, -1, 0};
}

// The best size of a score inside one bin, and of the first split whose score reaches `floor` that
// score and the values around it; (-1, 0, NaN, NaN) without a split.
//
// `members` are the positions of the bin's examples by ascending value; splits lie between included
// examples of different values only. `signed_mass` and `mass` are those of all lower bins.
std::tuple<int64_t, int64_t, double, double> interior_scores(Array<const std::int32_t, 1> members,
                                                             Array<const float, 1> values,
                                                             int64_t signed_mass, int64_t mass,
                                                             Weights weighed, int64_t floor) {
    Left left{signed_mass, mass};
    int64_t best = -1, first = 0;
    double low = std::numeric_limits<double>::quiet_NaN(), high = low;
    float before = -std::numeric_limits<float>::infinity();
    bool found = false, has_before = false;
    for (int64_t i = 0; i < members.size(); ++i) {
        const int64_t n = members(i);
        if (!weighed.included(n)) continue;
        if (has_before && before < values(i) && left.splits(weighed)) {
            const int64_t score = left.score(weighed);
            best = std::max(best, std::abs(score));
            if (!found && std::abs(score) >= floor) {
                found = true;
                first = score;
                low = before;
                high = values(i);
            }
        }
        left.signed_mass += weighed.masses(n);
        left.mass += std::abs(weighed.masses(n));
        before = values(i);
        has_before = true;
    }
    return {best, first, low, high};
}

// The largest included value in bins up to `last_left`, the smallest in later bins.
struct NeighboursOfSplit {
    template <int BYTES>
    static PGM_INLINE std::tuple<double, double> run(Array<const std::uint8_t, 1> codes,
                                                     Array<const bool, 1> included,
                                                     Array<const float, 2> X,
                                                     Array<const int64_t, 1> rows, int64_t column,
                                                     int64_t last_left) {
        const int last = static_cast<int>(last_left);
        int below = -1, above = N_BINS;
        for (int64_t n = 0; n < codes.size(); ++n) {
            const int c = codes(n);
            below = std::max(below, included(n) && c <= last ? c : -1);
            above = std::min(above, included(n) && c > last ? c : N_BINS);
        }
        double low = -INFINITE, high = INFINITE;
        for (int64_t n = 0; n < codes.size(); ++n) {
            if (!included(n) || (codes(n) != below && codes(n) != above)) continue;
            const double x = X(rows(n), column);
            if (codes(n) == below)
                low = std::max(low, x);
            else
                high = std::min(high, x);
        }
        return {low, high};
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("score_bins", score_bins, "codes"_a, "planes"_a, "weighed"_a, "fine"_a,
               "best_edge"_a);
    module.add("promising_bins", promising_bins, "planes"_a, "fine"_a, "pure"_a, "total"_a,
               "floor"_a, "out"_a);
    module.add("first_good_edge", first_good_edge, "planes"_a, "fine"_a, "weighed"_a, "floor"_a);
    module.add("interior_scores", interior_scores, "members"_a, "values"_a, "signed_mass"_a,
               "mass"_a, "weighed"_a, "floor"_a);
    module.add("neighbours_of_split", pgm::variants<NeighboursOfSplit>, "codes"_a, "included"_a,
               "X"_a, "rows"_a, "column"_a, "last_left"_a);
}
