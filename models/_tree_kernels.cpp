// Growing a tree: masses, histograms of nodes, their best splits, routing.
//
// The two sums that a split is judged by share one 64-bit number: the gradient mass, signed, times
// 2**32, plus the curvature mass, which is never negative. Curvature masses of all examples together
// stay below 2**32, so that sums never carry into the gradient, and are exact in whatever order they
// are taken. One addition per example and feature fills a histogram of both.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <nanobind/stl/tuple.h>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr int N_BINS = 256;
constexpr int64_t BLOCK = 64;  // rows whose values stay in the cache while all features are looked at
constexpr int HALF = 32;       // bits of the curvature mass
constexpr int GROUP = 4;  // histograms filled together: additions to one need not wait for the others

double gradient_of(int64_t mass) { return static_cast<double>(mass >> HALF); }
double curvature_of(int64_t mass) { return static_cast<double>(mass & 0xFFFFFFFF); }

// The examples whose histograms are filled, side by side; see tree_search.py.
template <class Number, class Mass> struct Listed {
    Array<Number, 1> position;  // where they stand in the rows of codes,
    Array<Number, 1> base;      // where the histogram of the node they lie in begins,
    Array<Mass, 1> mass;        // and both masses
    auto fields() { return std::tie(position, base, mass); }
};
using Examples = Listed<const std::uint32_t, const int64_t>;

// Write (+-w, w) of every example, with all weights scaled to the sum `whole` and rounded.
void gentle_masses(Array<double, 1> weights, Array<const int64_t, 2> segments, double whole,
                   Array<int64_t, 1> masses) {
    double total = 0.0;
    for (int64_t s = 0; s < segments.shape(0); ++s)
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) total += weights(n);
    const double scale = whole / total;
    for (int64_t s = 0; s < segments.shape(0); ++s) {
        const int64_t sign = segments(s, 2) == 1 ? 1 : -1;
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            weights(n) *= scale;
            const int64_t mass = std::llrint(weights(n));
            masses(n) = (sign * mass << HALF) + mass;
        }
    }
}

// Multiply each weight by the `factor` of its side and leaf.
void raise_weights(Array<const std::uint8_t, 1> leaf, Array<const int64_t, 2> segments,
                   Array<const double, 2> factor, Array<double, 1> weights) {
    for (int64_t s = 0; s < segments.shape(0); ++s) {
        const double *own = &factor(segments(s, 2), 0);
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) weights(n) *= own[leaf(n)];
    }
}

// Write the least and the largest value in every bin of every kept column.
void bin_extents(Array<const float, 2> X, Array<const int64_t, 1> rows,
                 Array<const int64_t, 1> columns, Array<const std::uint8_t, 2> codes,
                 Array<float, 2> low, Array<float, 2> high) {
    std::fill(low.begin(), low.end(), std::numeric_limits<float>::infinity());
    std::fill(high.begin(), high.end(), -std::numeric_limits<float>::infinity());
    for (int64_t block = 0; block < rows.size(); block += BLOCK) {
        const int64_t end = std::min(block + BLOCK, rows.size());
        for (int64_t j = 0; j < columns.size(); ++j) {
            const std::uint8_t *code = &codes(j, 0);
            float *least = &low(j, 0), *most = &high(j, 0);
            for (int64_t i = block; i < end; ++i) {
                const float x = X(rows(i), columns(j));
                least[code[i]] = std::min(least[code[i]], x);
                most[code[i]] = std::max(most[code[i]], x);
            }
        }
    }
}

// List the examples that lie in a chosen node; return how many there are.
int64_t examples_of_nodes(Array<const int64_t, 2> segments, Array<const std::uint8_t, 1> node,
                          Array<const bool, 1> chosen, Array<const int64_t, 1> masses,
                          Listed<std::uint32_t, int64_t> found) {
    int64_t count = 0;
    for (int64_t s = 0; s < segments.shape(0); ++s)
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            found.position(count) = static_cast<std::uint32_t>(n);
            found.base(count) = static_cast<std::uint32_t>(node(n)) * N_BINS;
            found.mass(count) = masses(n);
            count += chosen(node(n));  // if it is not, the next one takes its place
        }
    return count;
}

// Fill the histograms (nodes * 256) of up to four features at once.
void fill_group(const Array<const std::uint8_t, 2> &codes, const int64_t *planes, int64_t n_planes,
                const Examples &examples, const Array<int64_t, 2> &histograms) {
    const int64_t size = histograms.shape(1);
    std::vector<int64_t> unused(n_planes < GROUP ? size : 0);
    const std::uint8_t *code[GROUP];
    int64_t *sums[GROUP];
    for (int64_t a = 0; a < GROUP; ++a) {
        code[a] = &codes(planes[std::min(a, n_planes - 1)], 0);
        sums[a] = a < n_planes ? &histograms(planes[a], 0) : unused.data();
        std::fill_n(sums[a], size, 0);
    }
    for (int64_t i = 0; i < examples.mass.size(); ++i) {
        const int64_t n = examples.position(i), base = examples.base(i), mass = examples.mass(i);
        for (int a = 0; a < GROUP; ++a) sums[a][base + code[a][n]] += mass;
    }
}

// Complete a feature's histograms (nodes * 256) from those of the nodes' parents.
//
// `lighter[p]` is the child of node p whose histogram is filled, or -1 where p was not split: its
// left child is p again and its right child is empty.
void subtract_siblings(const int64_t *parents, const Array<const int64_t, 1> &lighter,
                       int64_t *histograms) {
    for (int64_t p = 0; p < lighter.size(); ++p) {
        const int64_t *whole = parents + p * N_BINS, one = lighter(p);
        if (one < 0) {
            std::copy_n(whole, N_BINS, histograms + 2 * p * N_BINS);
            continue;
        }
        const int64_t *part = histograms + one * N_BINS;
        int64_t *rest = histograms + (4 * p + 1 - one) * N_BINS;
        for (int b = 0; b < N_BINS; ++b) rest[b] = whole[b] - part[b];
    }
}

// G^2 / H on the left plus that on the right, or -1 where a side is lighter than `least`.
double split_score(int64_t left, int64_t total, double least) {
    const double left_h = curvature_of(left), right_h = curvature_of(total) - left_h;
    if (left_h < least || right_h < least) return -1.0;
    const double left_g = gradient_of(left), right_g = gradient_of(total) - left_g;
    return left_g * left_g / left_h + right_g * right_g / right_h;
}

// The best score of the splits of a feature in a node, -1 where it has none.
double best_score(const int64_t *histogram, int64_t total, double least) {
    double top = -1.0;
    int64_t left = 0;
    for (int b = 0; b < N_BINS; ++b) {
        if (histogram[b] == 0) continue;
        left += histogram[b];
        top = std::max(top, split_score(left, total, least));
    }
    return top;
}

// Fill the histograms (D, nodes * 256) of some features, and score their splits (D, nodes).
//
// The `examples` are those of the nodes `lighter`; the histograms of the others are what is left of
// their `parents` (D, nodes * 128). At the root, whose examples are all there, these are not looked
// at.
void score_features(Array<const std::uint8_t, 2> codes, Array<const int64_t, 1> planes,
                    Examples examples, Array<const int64_t, 2> parents,
                    Array<const int64_t, 1> lighter, Array<const int64_t, 1> totals, int64_t least,
                    Array<int64_t, 2> histograms, Array<double, 2> best) {
    for (int64_t a = 0; a < planes.size(); a += GROUP)
        fill_group(codes, &planes(a), std::min<int64_t>(GROUP, planes.size() - a), examples,
                   histograms);
    for (int64_t j : planes) {
        if (totals.size() > 1) subtract_siblings(&parents(j, 0), lighter, &histograms(j, 0));
        for (int64_t p = 0; p < totals.size(); ++p)
            best(j, p) = best_score(&histograms(j, p * N_BINS), totals(p), static_cast<double>(least));
    }
}

// The last bin, and the masses, on the left of a node's first split that reaches `floor`.
std::tuple<int64_t, int64_t> first_split_reaching(Array<const int64_t, 1> histogram, int64_t total,
                                                  int64_t least, double floor) {
    int64_t left = 0;
    for (int64_t b = 0; b < N_BINS; ++b) {
        if (histogram(b) == 0) continue;
        left += histogram(b);
        if (split_score(left, total, static_cast<double>(least)) >= floor) return {b, left};
    }
    return {-1, 0};
}

// Replace each example's `node` p by its child, 2 p on the left, 2 p + 1 on the right.
//
// Adds up in `counts` how many examples every child has.
void route_examples(Array<const std::uint8_t, 2> codes, Array<const int64_t, 2> segments,
                    Array<const int64_t, 1> plane, Array<const int64_t, 1> last_left,
                    Array<std::uint8_t, 1> node, Array<int64_t, 1> counts) {
    for (int64_t s = 0; s < segments.shape(0); ++s)
        for (int64_t n = segments(s, 0); n < segments(s, 1); ++n) {
            const int p = node(n), child = 2 * p + (codes(plane(p), n) > last_left(p));
            node(n) = static_cast<std::uint8_t>(child);
            ++counts(child);
        }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("gentle_masses", gentle_masses, "weights"_a, "segments"_a, "whole"_a, "masses"_a);
    module.add("raise_weights", raise_weights, "leaf"_a, "segments"_a, "factor"_a, "weights"_a);
    module.add("bin_extents", bin_extents, "X"_a, "rows"_a, "columns"_a, "codes"_a, "low"_a,
               "high"_a);
    module.add("examples_of_nodes", examples_of_nodes, "segments"_a, "node"_a, "chosen"_a,
               "masses"_a, "found"_a);
    module.add("score_features", score_features, "codes"_a, "planes"_a, "examples"_a, "parents"_a,
               "lighter"_a, "totals"_a, "least"_a, "histograms"_a, "best"_a);
    module.add("first_split_reaching", first_split_reaching, "histogram"_a, "total"_a, "least"_a,
               "floor"_a);
    module.add("route_examples", route_examples, "codes"_a, "segments"_a, "plane"_a, "last_left"_a,
               "node"_a, "counts"_a);
}
