// Graphs and potentials as kernels take them, and the messages that message-passing kernels share.

#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pgm_places/kernels/array.hpp"

namespace pgm {

constexpr double INF = std::numeric_limits<double>::infinity();
constexpr std::uint32_t FORTH = 0, REVERSE = 1;  // see Arcs in adjacency.py

using Arc = std::uint32_t;
using Row = Array<double, 1>;
using ConstRow = Array<const double, 1>;
using Matrix = Array<double, 2>;
using ConstMatrix = Array<const double, 2>;

struct Arcs {  // see adjacency.py
    Array<const std::uint32_t, 1> start, head, arc, ends;
    auto fields() { return std::tie(start, head, arc, ends); }
};

// Log-potentials of a pairwise model; kernels are compiled for each number N of dimensions.
//
// `pairwise` are (E, K) rewards of agreement, or tables (E, K, K), or one table (1, K, K) for all
// edges, or what tables that fall with the distance of labels are made of: (1 + 3 E,) the power of the
// distance, then base, weight and cap of each edge, or (4,) of all.
template <int N> struct Terms {
    ConstMatrix unary;  // (N, K)
    Array<const double, N> pairwise;
    auto fields() { return std::tie(unary, pairwise); }
};

// Which of the tables is that of an arc's edge.
inline std::int64_t table_at(const Array<const double, 3> &tables, Arc arc) {
    return tables.shape(0) > 1 ? arc >> 1 : 0;
}

// Where the numbers of an arc's edge begin: base, weight, cap.
inline const double *distance_at(const Array<const double, 1> &distances, Arc arc) {
    return distances.data() + (distances.shape(0) > 4 ? 1 + 3 * static_cast<std::int64_t>(arc >> 1) : 1);
}

// The potential of the arc's edge, its owner labelled `mine` and its head `theirs`.
template <int N>
inline double edge_score(const Array<const double, N> &pairwise, Arc arc, std::int64_t mine,
                         std::int64_t theirs) {
    if constexpr (N == 2) {
        return mine == theirs ? pairwise(arc >> 1, mine) : 0.0;
    } else if constexpr (N == 1) {
        const double *of_edge = distance_at(pairwise, arc);
        const double apart = static_cast<double>(std::abs(mine - theirs));
        const double cost = of_edge[1] * (pairwise(0) == 1.0 ? apart : apart * apart);
        return of_edge[0] - std::min(cost, of_edge[2]);
    } else {
        const std::int64_t at = table_at(pairwise, arc);
        return arc & 1 ? pairwise(at, theirs, mine) : pairwise(at, mine, theirs);
    }
}

// Add to `value` (K,) the potential of each label of the arc's owner beside `theirs`.
//
// Returns the size of a reward that was added, 0 for tables.
template <int N>
inline double add_edge(const Array<const double, N> &pairwise, Arc arc, std::int64_t theirs,
                       double *value, std::int64_t n_labels) {
    if constexpr (N == 2) {
        const double reward = pairwise(arc >> 1, theirs);
        value[theirs] += reward;
        return std::fabs(reward);
    } else {
        for (std::int64_t k = 0; k < n_labels; ++k) value[k] += edge_score(pairwise, arc, k, theirs);
        return 0.0;
    }
}

// `out[b] = max_a sent[a] - weight |a - b|`: what is passed on step by step, both ways.
inline void cones(const double *sent, double weight, double *out, std::int64_t n_labels) {
    double from_left = -INF, from_right = -INF;
    for (std::int64_t b = 0; b < n_labels; ++b) {
        from_left -= weight;
        if (sent[b] > from_left) from_left = sent[b];
        out[b] = from_left;
    }
    for (std::int64_t b = n_labels - 1; b >= 0; --b) {
        from_right -= weight;
        if (sent[b] > from_right) from_right = sent[b];
        if (from_right > out[b]) out[b] = from_right;
    }
}

// `out[b] = max_a sent[a] - weight (a - b)^2`, from the envelope's parabolas in order.
inline void parabolas(const double *sent, double weight, double *out, std::int64_t n_labels) {
    std::vector<std::int64_t> apex(n_labels);
    std::vector<double> begins(n_labels);
    std::int64_t n = 0;
    for (std::int64_t a = 0; a < n_labels; ++a) {
        if (sent[a] == -INF) continue;
        double start = -INF;
        while (n > 0) {
            const std::int64_t other = apex[n - 1];
            const double middle = 0.5 * static_cast<double>(a + other);
            start = middle - 0.5 * (sent[a] - sent[other]) / (weight * static_cast<double>(a - other));
            if (start > begins[n - 1]) break;
            n -= 1;
            start = -INF;
        }
        apex[n] = a;
        begins[n] = start;
        n += 1;
    }
    if (n == 0) {
        std::fill(out, out + n_labels, -INF);
        return;
    }
    std::int64_t at = 0;
    for (std::int64_t b = 0; b < n_labels; ++b) {
        while (at + 1 < n && begins[at + 1] < static_cast<double>(b)) at += 1;
        const double away = static_cast<double>(b - apex[at]);
        out[b] = sent[apex[at]] - weight * away * away;
    }
}

// `out[b] = max_a sent[a] + potential(a, b)`; all -inf if all `sent` are.
//
// `out[b] = max_a sent[a] - min(w |a - b|^p, c)` with p = 1 or 2 is the upper envelope of K cones or
// parabolas, cut off below at the largest `sent` less c (P. Felzenszwalb, D. Huttenlocher, "Efficient
// belief propagation for early vision", IJCV 2006; "Distance transforms of sampled functions", 2004).
inline void max_of_distances(const double *sent, Arc arc, const Array<const double, 1> &distances,
                             double *out, std::int64_t n_labels) {
    const double *of_edge = distance_at(distances, arc);
    const double base = of_edge[0], weight = of_edge[1], cap = of_edge[2];
    double top = -INF;
    for (std::int64_t a = 0; a < n_labels; ++a)
        if (sent[a] > top) top = sent[a];
    if (distances(0) == 1.0) cones(sent, weight, out, n_labels);
    else parabolas(sent, weight, out, n_labels);
    const double floor = top - cap;
    for (std::int64_t b = 0; b < n_labels; ++b) out[b] = base + (out[b] > floor ? out[b] : floor);
}

// Take the largest entry out of all, unless all are -inf; that entry.
inline double subtract_top(double *out, std::int64_t n_labels) {
    double top = out[0];
    for (std::int64_t b = 1; b < n_labels; ++b)
        if (out[b] > top) top = out[b];
    if (top > -INF)
        for (std::int64_t b = 0; b < n_labels; ++b) out[b] -= top;
    return top;
}

// `out[b] = max_a sent[a] + edge potential(a, b)`, less its largest; all -inf if none is.
//
// The message goes along `arc`, from its owner to its head.
template <int N>
inline void pass_max(const double *sent, Arc arc, const Array<const double, N> &pairwise, double *out,
                     std::int64_t n_labels) {
    if constexpr (N == 2) {
        double first = -INF, second = -INF;
        for (std::int64_t a = 0; a < n_labels; ++a) {
            const double low = sent[a] < first ? sent[a] : first;
            first = sent[a] > first ? sent[a] : first;
            second = low > second ? low : second;
        }
        for (std::int64_t b = 0; b < n_labels; ++b) {
            const double other = sent[b] < first ? first : second;
            const double agreed = sent[b] + pairwise(arc >> 1, b);
            out[b] = agreed > other ? agreed : other;
        }
    } else if constexpr (N == 1) {
        max_of_distances(sent, arc, pairwise, out, n_labels);
    } else {
        const std::int64_t at = table_at(pairwise, arc);
        for (std::int64_t b = 0; b < n_labels; ++b) {
            out[b] = -INF;
            for (std::int64_t a = 0; a < n_labels; ++a) {
                const double value = sent[a] + (arc & 1 ? pairwise(at, b, a) : pairwise(at, a, b));
                if (value > out[b]) out[b] = value;
            }
        }
    }
    subtract_top(out, n_labels);
}

// The same for sums and rewards of agreement: every label shares one sum over the other labels.
//
// The best label's sum over the others is kept relative to the second best, so that nothing is lost
// however far apart they are.
inline void sum_agreement(const double *sent, const double *agreement, double *out,
                          std::int64_t n_labels) {
    std::int64_t best = 0;
    for (std::int64_t a = 1; a < n_labels; ++a)
        if (sent[a] > sent[best]) best = a;
    double second = -INF;
    for (std::int64_t a = 0; a < n_labels; ++a)
        if (a != best && sent[a] > second) second = sent[a];
    if (sent[best] == -INF) {
        std::fill(out, out + n_labels, -INF);
        return;
    }
    double near_second = 0.0;
    for (std::int64_t a = 0; a < n_labels; ++a) {
        out[a] = std::exp(sent[a] - sent[best]);
        if (a != best && second > -INF) near_second += std::exp(sent[a] - second);
    }
    double total = 0.0;
    for (std::int64_t a = 0; a < n_labels; ++a) total += out[a];
    for (std::int64_t b = 0; b < n_labels; ++b) {
        double others = -INF;
        if (b != best) others = sent[best] + std::log(total - out[b]);
        else if (second > -INF) others = second + std::log(near_second);
        const double agreed = sent[b] + agreement[b];
        const double high = agreed > others ? agreed : others;
        const double low = agreed > others ? others : agreed;
        out[b] = high + std::log1p(std::exp(low - high));
    }
}

// `out[b] = log sum_a exp(sent[a] + edge potential(a, b))`, less its largest.
//
// That largest is returned; all are -inf if no label is possible.
template <int N>
inline double pass_sum(const double *sent, Arc arc, const Array<const double, N> &pairwise,
                       double *out, std::int64_t n_labels) {
    if constexpr (N == 2) {
        sum_agreement(sent, &pairwise(arc >> 1, 0), out, n_labels);
    } else if constexpr (N == 1) {
        std::fill(out, out + n_labels, -INF);  // sums are never asked for: they take the tables
    } else {
        const std::int64_t at = table_at(pairwise, arc);
        for (std::int64_t b = 0; b < n_labels; ++b) {
            double top = -INF;
            for (std::int64_t a = 0; a < n_labels; ++a) {
                const double value = sent[a] + (arc & 1 ? pairwise(at, b, a) : pairwise(at, a, b));
                if (value > top) top = value;
            }
            double total = 0.0;
            if (top > -INF)
                for (std::int64_t a = 0; a < n_labels; ++a)
                    total += std::exp(sent[a] + (arc & 1 ? pairwise(at, b, a) : pairwise(at, a, b)) -
                                      top);
            out[b] = total > 0.0 ? top + std::log(total) : -INF;
        }
    }
    return subtract_top(out, n_labels);
}

// Add to `value` (K,) what the edge is expected to give each label of the arc's owner.
template <int N>
inline void add_expected(const Array<const double, N> &pairwise, Arc arc, const double *theirs,
                         double *value, std::int64_t n_labels) {
    if constexpr (N == 2) {
        for (std::int64_t k = 0; k < n_labels; ++k) value[k] += pairwise(arc >> 1, k) * theirs[k];
    } else {
        const std::int64_t at = table_at(pairwise, arc);
        for (std::int64_t other = 0; other < n_labels; ++other) {
            if (!(theirs[other] > 0.0)) continue;  // 0 times -inf counts nothing
            for (std::int64_t k = 0; k < n_labels; ++k) {
                const double pair = arc & 1 ? pairwise(at, other, k) : pairwise(at, k, other);
                value[k] += pair * theirs[other];
            }
        }
    }
}

}  // namespace pgm
