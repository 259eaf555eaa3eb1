// Moving excess along before the trees of a minimum cut grow: most of the flow, cheaply.
//
// Any push through arcs that have the capacity is a valid flow between the terminals and the nodes,
// so nothing here can change the cut; it only leaves less for the search.

#pragma once

#include "solvers/_pairwise.hpp"

namespace pgm {

// Capacities beyond this are left to the search, lest their sum overflow.
constexpr double TOO_LARGE = 0x1p900;
// A sweep there that takes off less than this share of the first excess is the last but one: another
// round would cost more than the augmentations that it saves.
constexpr double WORTHWHILE = 0.07;
// What each node keeps in the last sweep. Where all is passed on, nodes are left without excess, and
// both trees would have to be grown over them again.
constexpr double KEPT = 0.125;

// The largest of all excesses, of either sign, and capacities.
inline double largest_of(std::int64_t n_nodes, std::int64_t n_slots, const Row &excess,
                         const Row &capacity) {
    double largest = 0.0;
    for (std::int64_t i = 0; i < n_nodes; ++i) largest = std::max(largest, std::fabs(excess(i)));
    for (std::int64_t a = 0; a < n_slots; ++a) largest = std::max(largest, capacity(a));
    return largest;
}

// Sweep over the nodes, there and back; each passes its excess or deficit on to later ones.
//
// This is the update of sequential tree-reweighted message passing for two labels (Kolmogorov, PAMI
// 2006), which approaches the largest flow; excesses that meet cancel out. Shares are multiples of one
// power of two that all sums are representable in, so capacities that are exact in this sense stay so.
inline void spread_excess(std::int64_t n_nodes, Arcs arcs, Row excess, Row capacity) {
    const auto &[start, head, arc, ends] = arcs;
    const std::int64_t n_slots = start(n_nodes);
    const double largest = largest_of(n_nodes, n_slots, excess, capacity);
    if (largest > TOO_LARGE) return;
    int exponent;
    std::frexp(largest * static_cast<double>(n_nodes + n_slots), &exponent);  // no sum can be larger
    const double anchor = std::ldexp(3.0, exponent);  // rounds to multiples of 2 ** (exponent - 51)
    double first = 0.0;
    for (std::int64_t m = 0; m < n_nodes; ++m) first += std::fabs(excess(m));
    double before = first, passed = 1.0;
    for (bool ahead = true;; ahead = !ahead) {
        double rest = 0.0;
        for (std::int64_t m = 0; m < n_nodes; ++m) {
            const std::int64_t i = ahead ? m : n_nodes - 1 - m;
            std::int64_t low = start(i), high = start(i + 1);
            if (ahead)
                while (low < high && head(low) < i) ++low;
            else
                while (low < high && head(high - 1) > i) --high;
            double left = excess(i);
            if (low < high) {
                const double share = (passed * left / static_cast<double>(high - low) + anchor) - anchor;
                for (std::int64_t slot = low; slot < high; ++slot) {
                    const Arc forth = arc(slot);
                    const double push = std::max(-capacity(forth ^ REVERSE),
                                                 std::min(capacity(forth), share));
                    capacity(forth) -= push;
                    capacity(forth ^ REVERSE) += push;
                    excess(head(slot)) += push;
                    left -= push;
                }
                excess(i) = left;
            }
            rest += std::fabs(left);
        }
        if (ahead) {
            if (!(before - rest > WORTHWHILE * first)) passed = 1.0 - KEPT;
            before = rest;
        } else if (passed < 1.0) {
            return;
        }
    }
}

// Push what fits from nodes at the source to neighbours at the sink, in one pass.
//
// These are the shortest augmentations and by far the most; in the order of the nodes they cost a
// small part of what they cost the trees.
inline void push_between_neighbours(std::int64_t n_nodes, const Arcs &arcs, const Row &excess,
                                    const Row &capacity) {
    const auto &[start, head, arc, ends] = arcs;
    for (std::int64_t i = 0; i < n_nodes; ++i) {
        if (excess(i) <= 0.0) continue;
        for (std::int64_t slot = start(i); slot < start(i + 1); ++slot) {
            const std::int64_t j = head(slot);
            if (!(excess(j) < 0.0)) continue;
            const Arc forth = arc(slot);
            const double push = std::min(std::min(excess(i), -excess(j)), capacity(forth));
            capacity(forth) -= push;
            capacity(forth ^ REVERSE) += push;
            excess(i) -= push;
            excess(j) += push;
            if (excess(i) <= 0.0) break;
        }
    }
}

}  // namespace pgm
