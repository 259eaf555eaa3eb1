// Relaxation labelling of a raster: one update of all beliefs in their store.
//
// The store is laid out by _belief_store_kernels; a block of sixteen cells is one vector. Beliefs are
// updated in place, so that the old rows around the one at hand are read ahead. The raster is divided
// into parts of whole rows: of each part's first and last row there is a copy from before the update
// for the parts next to it, which may be updated at the same time.

#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

constexpr int LANES = 16;
constexpr float MIN_MASS = 1e-12f;  // labels that keep less than this together stay as they are
constexpr float SMALLEST = 1e-30f;  // beliefs below become 0: they cannot return, and subnormal
                                    // numbers are slow

template <int BYTES> using Block = pgm::Simd<float, LANES, BYTES>;

struct Store {  // see grid_relaxation.py
    Array<float, 2> beliefs;
    Array<const std::uint8_t, 1> codes;
    Array<const int64_t, 1> row_start, span_start;
    Array<const int64_t, 2> spans;
    Array<const int64_t, 1> part_start;
    auto fields() { return std::tie(beliefs, codes, row_start, span_start, spans, part_start); }
};

// How beliefs are renewed.
struct Update {
    Array<const float, 3> tables;  // (1 or 8, K, K + 1), one table or one per direction
    float ratio, damping;
    auto fields() { return std::tie(tables, ratio, damping); }
};

// The old rows (K, L) around a block, and its column in each.
struct Around {
    const float *above, *here, *below;
    int64_t length;

    template <class L> PGM_INLINE L at(const float *row, int label, int64_t column) const {
        return L::load(row + label * length + column);
    }
};

// The weighted sums over the neighbours of a block: per label, and of walls.
template <class L>
PGM_INLINE void sum_neighbours(const Around &around, const std::uint8_t *codes, float weight,
                               int n_labels, L *seen) {
    const L ratio = L::splat(weight);
    for (int k = 0; k < n_labels; ++k) {
        L sides = around.at<L>(around.above, k, 0) + around.at<L>(around.below, k, 0);
        sides = sides + around.at<L>(around.here, k, -1) + around.at<L>(around.here, k, 1);
        L corners = around.at<L>(around.above, k, -1) + around.at<L>(around.above, k, 1);
        corners = corners + around.at<L>(around.below, k, -1) + around.at<L>(around.below, k, 1);
        seen[k] = fma(corners, ratio, sides);
    }
    seen[n_labels] =
        fma(pgm::field_at<L>(codes, 4, 15), ratio, pgm::field_at<L>(codes, 0, 15));
}

// A block's neighbours in one direction: a label's beliefs, or whether they are walls.
template <class L>
PGM_INLINE L line(const Around &around, const std::uint8_t *codes, int direction, int label,
                  int n_labels) {
    if (label == n_labels) return pgm::field_at<L>(codes, direction, 1);
    if (direction < 3) return around.at<L>(around.above, label, direction - 1);
    if (direction < 5) return around.at<L>(around.here, label, 2 * (direction - 3) - 1);
    return around.at<L>(around.below, label, direction - 6);
}

// `1 + q` of a block (paper eq. 5) for each label.
template <class L>
PGM_INLINE void add_support(const Around &around, const std::uint8_t *codes, const Update &update,
                            int n_labels, L *seen, L *grown) {
    const float *tables = update.tables.data();
    const int width = n_labels + 1;
    if (update.tables.shape(0) == 1) {
        sum_neighbours(around, codes, update.ratio, n_labels, seen);
        for (int j = 0; j < n_labels; ++j) {
            L sum = L::splat(1.0f);
            for (int k = 0; k < width; ++k)
                sum = fma(seen[k], L::splat(tables[j * width + k]), sum);
            grown[j] = sum;
        }
        return;
    }
    for (int j = 0; j < n_labels; ++j) grown[j] = L::splat(1.0f);
    for (int d = 0; d < 8; ++d)
        for (int k = 0; k < width; ++k) {
            const L beliefs = line<L>(around, codes, d, k, n_labels);
            for (int j = 0; j < n_labels; ++j)
                grown[j] = grown[j] + beliefs * L::splat(tables[(d * n_labels + j) * width + k]);
        }
}

// What the lanes of a part have come to.
template <class L> struct Sums {
    L most, moved, support;
};

// Normalise `p (1 + q)` of a block (paper eq. 4), damp, write it to the store.
template <class L>
PGM_INLINE void settle(const Around &around, float damping, int n_labels, L *grown, float *beliefs,
                       int64_t stride, Sums<L> &sums) {
    const L zero = L::splat(0.0f), one = L::splat(1.0f);
    L total = zero, support = zero;
    for (int j = 0; j < n_labels; ++j) {
        const L before = around.at<L>(around.here, j, 0);
        grown[j] = before * largest(grown[j], zero);
        total = total + grown[j];
        support = support + (grown[j] - before);
    }
    const auto usable = total > L::splat(MIN_MASS);
    const L kept = select(usable, L::splat(damping), one);
    const L scale = select(usable, L::splat(1.0f - damping) / select(usable, total, one), zero);
    L most = zero, moved = zero;
    for (int j = 0; j < n_labels; ++j) {
        const L before = around.at<L>(around.here, j, 0);
        L after = fma(grown[j], scale, kept * before);
        after = select(after > L::splat(SMALLEST), after, zero);
        after.store(beliefs + j * stride);
        const L change = absolute(after - before);
        most = largest(change, most);
        moved = moved + change;
    }
    sums.most = largest(most, sums.most);
    sums.moved = sums.moved + moved;
    sums.support = sums.support + support;
}

PGM_INLINE void copy_row(const Array<float, 2> &beliefs, int64_t begin, int64_t end, float *out,
                         int64_t length) {
    for (int64_t k = 0; k < beliefs.shape(0); ++k)
        std::memcpy(out + k * length, &beliefs(k, 0) + begin, (end - begin) * sizeof(float));
}

// Copy the first and the last row of a part to `edges[part + 1]` (2, K, L).
void copy_edges(Store store, int64_t part, Array<float, 4> edges) {
    const int64_t rows[] = {store.part_start(part), store.part_start(part + 1) - 1};
    for (int side = 0; side < 2; ++side)
        copy_row(store.beliefs, store.row_start(rows[side]), store.row_start(rows[side] + 1),
                 &edges(part + 1, side, 0, 0), edges.shape(3));
}

// Update the rows of a part; `totals` get largest change, sum of changes, sum of p q.
//
// LABELS is the number of labels, or 0 for any number.
template <int BYTES, int LABELS>
PGM_INLINE void update_part(const Store &store, const Update &update, const Array<float, 3> &rows,
                            Block<BYTES> *work, int64_t part, const Array<const float, 4> &edges,
                            double *totals) {
    using L = Block<BYTES>;
    using Wide = pgm::Simd<double, LANES, BYTES>;
    const int n_labels = LABELS > 0 ? LABELS : static_cast<int>(store.beliefs.shape(0));
    const int64_t stride = store.beliefs.shape(1), length = rows.shape(2);
    const int64_t first = store.part_start(part), last = store.part_start(part + 1);
    const auto &row_start = store.row_start;
    L *seen = work, *grown = work + n_labels + 1;
    L most = L::splat(0.0f);
    Wide all_moved = Wide::splat(0.0), all_support = Wide::splat(0.0);
    const float *above = &edges(part, 1, 0, 0), *here = &rows(0, 0, 0);
    copy_row(store.beliefs, row_start(first), row_start(first + 1), &rows(0, 0, 0), length);
    for (int64_t y = first; y < last; ++y) {
        const int64_t begin = row_start(y), end = row_start(y + 1);
        const float *below = &edges(part + 2, 0, 0, 0);
        if (y < last - 1) {  // whole rows are read ahead: memory is fastest in long runs
            float *ahead = &rows((y - first + 1) % 3, 0, 0);
            copy_row(store.beliefs, end, row_start(y + 2), ahead, length);
            below = ahead;
        }
        Sums<L> sums = {most, L::splat(0.0f), L::splat(0.0f)};
        for (int64_t s = store.span_start(y); s < store.span_start(y + 1); ++s) {
            const int64_t *span = &store.spans(s, 0);
            const float *above_span = above + span[1] - row_start(y - 1);
            const float *here_span = here + span[2] - begin, *below_span = below + span[3] - end;
            for (int64_t i = 0; i < span[0]; i += LANES) {
                const Around around = {above_span + i, here_span + i, below_span + i, length};
                const int64_t at = span[2] + i;
                add_support(around, store.codes.data() + at, update, n_labels, seen, grown);
                settle(around, update.damping, n_labels, grown, store.beliefs.data() + at, stride,
                       sums);
            }
        }
        most = sums.most;
        all_moved = all_moved + widen(sums.moved);
        all_support = all_support + widen(sums.support);
        above = here;
        here = below;
    }
    totals[0] = highest_lane(most);
    totals[1] = sum_in_order(all_moved);
    totals[2] = sum_in_order(all_support);
}

// Update some parts in place (paper eq. 4 and 5), the first to the one before the last.
//
// `rows` (3, K, L) are rows that are read ahead. `old_edges` (P + 2, 2, K, L) hold the first and last
// row of each part as they are, between two parts of nothing; `new_edges` get them as they become.
// `out` (P, 3) gets each part's largest change, sum of changes, and sum of p q over labels and nodes.
struct UpdateParts {
    template <int BYTES>
    static PGM_INLINE void run(Store store, Update update, Array<float, 3> rows, int64_t first,
                               int64_t last, Array<const float, 4> old_edges,
                               Array<float, 4> new_edges, Array<double, 2> out) {
        const int64_t n_labels = store.beliefs.shape(0);
        std::vector<Block<BYTES>> work(n_labels > 4 ? 2 * n_labels + 1 : 0);
        Block<BYTES> few[9];
        for (int64_t part = first; part < last; ++part) {
            double *totals = &out(part, 0);
            if (n_labels == 2)
                update_part<BYTES, 2>(store, update, rows, few, part, old_edges, totals);
            else if (n_labels == 3)
                update_part<BYTES, 3>(store, update, rows, few, part, old_edges, totals);
            else if (n_labels == 4)
                update_part<BYTES, 4>(store, update, rows, few, part, old_edges, totals);
            else
                update_part<BYTES, 0>(store, update, rows, n_labels > 4 ? work.data() : few, part,
                                      old_edges, totals);
            copy_edges(store, part, new_edges);
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("copy_edges", copy_edges, "store"_a, "part"_a, "edges"_a);
    module.add("update_parts_of_raster", pgm::variants<UpdateParts>, "store"_a, "update"_a,
               "rows"_a, "first"_a, "last"_a, "old_edges"_a, "new_edges"_a, "out"_a);
}
