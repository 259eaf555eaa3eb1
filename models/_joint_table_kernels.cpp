// Tables of joint coarse bins: upkeep, margins, bounds on scores.

#include <algorithm>
#include <cmath>
#include <vector>

#include "models/weighted_examples.hpp"
#include "pgm_places/kernels/simd.hpp"

namespace {

using pgm::Array;
using pgm::Changes;
using std::int64_t;

constexpr int N_BINS = 256;
constexpr int64_t AHEAD = 128;  // changes before its use a cell is fetched: they lie far apart

struct JointTables {  // see sorted_features.py
    Array<const std::uint16_t, 2> cells;
    Array<const int64_t, 1> axes, planes, sizes, starts;
    Array<const bool, 2> pure;
    auto fields() { return std::tie(cells, axes, planes, sizes, starts, pure); }
};

// The masses in the cells of all tables, one after the other.
struct Cells {
    Array<int64_t, 1> positive, negative;
    auto fields() { return std::tie(positive, negative); }
};

// What each feature (D,) can reach.
struct Best {
    Array<int64_t, 1> edge;   // the best score of a split between coarse bins,
    Array<int64_t, 1> bound;  // and a bound on those inside them
    auto fields() { return std::tie(edge, bound); }
};

// Add changes of mass, from `start` to before `stop`, to the cells of their examples in two tables.
PGM_INLINE void add_changes(const std::uint16_t *cells, const std::uint16_t *more_cells,
                            const Changes &changed, int64_t start, int64_t stop, int64_t *table,
                            int64_t *another) {
    const std::uint32_t *position = changed.positions.data();
    const int64_t *change = changed.changes.data();
    for (int64_t i = start; i < stop; ++i) {
        const std::uint32_t later = position[std::min(i + AHEAD, stop - 1)], n = position[i];
        __builtin_prefetch(cells + later);
        __builtin_prefetch(more_cells + later);
        table[cells[n]] += change[i];
        another[more_cells[n]] += change[i];
    }
}

// Write the last axis's margin, and shrink the table in place by summing that axis.
PGM_INLINE void sum_last_axis(int64_t *__restrict table, int64_t n_rows, int64_t size,
                              int64_t *__restrict margin) {
    std::fill_n(margin, size, 0);
    for (int64_t row = 0; row < n_rows; ++row) {
        const int64_t *mass = table + row * size;
        int64_t whole = 0;
        for (int64_t b = 0; b < size; ++b) {
            margin[b] += mass[b];
            whole += mass[b];
        }
        table[row] = whole;
    }
}

// A feature's best edge, and a bound on the scores inside its bins, whose masses are `p` and `q`.
PGM_INLINE void score_axis(const int64_t *p, const int64_t *q, int64_t size, const bool *pure,
                           int64_t total, int64_t mass, int64_t &best_edge, int64_t &best_bound) {
    int64_t left = 0, seen = 0, edge = -1, bound = -1;
    for (int64_t b = 0; b < size; ++b) {
        if (!pure[b] && p[b] != q[b])
            bound = std::max({bound, std::abs(2 * (left + p[b]) - total),
                              std::abs(2 * (left + q[b]) - total)});
        left += p[b] + q[b];
        seen += p[b] - q[b];
        if (0 < seen && seen < mass) edge = std::max(edge, std::abs(2 * left - total));
    }
    best_edge = edge;
    best_bound = bound;
}

// Bring some tables, the first to the one before the last, up to date; find each feature's best
// coarse edge and a bound on the rest.
//
// The masses in `kept` are the sum of all changes so far; `sums` are those of the negative and of the
// positive masses. A table's margins are the histograms of its features, so one pass serves them all.
struct ScoreTables {
    template <int BYTES>
    static PGM_INLINE void run(int64_t first, int64_t last, JointTables tables, Changes changed,
                               Cells kept, Array<const int64_t, 1> sums, Best best) {
        const auto &[cells, axes, planes, sizes, starts, pure] = tables;
        const int64_t total = sums(1) + sums(0), mass = sums(1) - sums(0);
        std::vector<int64_t> table_p, table_q;
        for (int64_t t = first; t < last; t += 2) {
            const int64_t mate = t + 1;
            if (mate == last) table_p.assign(starts(t + 1) - starts(t), 0);
            for (int64_t s = 0; s < changed.spans.shape(0); ++s) {
                int64_t *side = (changed.spans(s, 2) == 1 ? kept.positive : kept.negative).data();
                const bool alone = mate == last;
                add_changes(&cells(t, 0), &cells(alone ? t : mate, 0), changed,
                            changed.spans(s, 0), changed.spans(s, 1), side + starts(t),
                            alone ? table_p.data() : side + starts(mate));
            }
        }
        int64_t p[N_BINS], q[N_BINS];
        for (int64_t t = first; t < last; ++t) {
            int64_t n_cells = starts(t + 1) - starts(t);
            table_p.assign(kept.positive.data() + starts(t), kept.positive.data() + starts(t + 1));
            table_q.assign(kept.negative.data() + starts(t), kept.negative.data() + starts(t + 1));
            for (int64_t a = axes(t + 1) - 1; a >= axes(t); --a) {
                const int64_t size = sizes(a), j = planes(a);
                n_cells /= size;
                sum_last_axis(table_p.data(), n_cells, size, p);
                sum_last_axis(table_q.data(), n_cells, size, q);
                score_axis(p, q, size, &pure(j, 0), total, mass, best.edge(j), best.bound(j));
            }
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("score_tables", pgm::variants<ScoreTables>, "first"_a, "last"_a, "tables"_a,
               "changed"_a, "kept"_a, "sums"_a, "best"_a);
}
