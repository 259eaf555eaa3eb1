// Relaxation labelling of any graph: one update of all nodes.

#include <vector>

#include "pgm_places/kernels/simd.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int64_t;

// A node whose labels keep less than this together cannot be normalised: it stays as it is.
constexpr double MIN_MASS = 1e-12;

struct Neighbours {  // see relaxation.py
    Array<const std::uint32_t, 1> start, place;
    Array<const double, 1> weight;
    bool shared;
    auto fields() { return std::tie(start, place, weight, shared); }
};

template <int BYTES> using Four = pgm::Simd<double, 4, BYTES>;

// Update the nodes from `begin` to `end`, and fill the part's `sums`.
//
// FOURS is a fourth of the padded number of labels, or 0 for any number; `work` has room for twice as
// many blocks: sums over neighbours, then 1 + q.
template <int BYTES, int FOURS>
PGM_INLINE void update_part(const double *old, const Neighbours &around,
                            const Array<const double, 1> &tables, double damping, int64_t begin,
                            int64_t end, int64_t n_given, Four<BYTES> *work, double *out,
                            double *sums) {
    using L = Four<BYTES>;
    const int64_t n_fours = FOURS > 0 ? FOURS : n_given, width = 4 * n_fours;
    const int64_t n_tables = tables.shape(0) / (width * width);
    const std::uint32_t *start = around.start.data(), *place = around.place.data();
    const double *weight = around.weight.data();
    L *seen = work, *grown = work + n_fours;
    const L zero = L::splat(0.0);
    L most = zero, moved = zero;
    double support = 0.0;
    int64_t row = begin * n_tables;
    int64_t last = start[row];
    for (int64_t i = begin; i < end; ++i) {
        for (int64_t g = 0; g < n_fours; ++g) grown[g] = L::splat(1.0);
        for (int64_t d = 0; d < n_tables; ++d) {
            const int64_t first = last;
            last = start[++row];
            for (int64_t g = 0; g < n_fours; ++g) {
                L sum = zero;
                if (around.shared) {
                    for (int64_t e = first; e < last; ++e) sum = sum + L::load(old + place[e] + 4 * g);
                    sum = sum * L::splat(weight[i]);
                } else {
                    for (int64_t e = first; e < last; ++e)
                        sum = sum + L::load(old + place[e] + 4 * g) * L::splat(weight[e]);
                }
                seen[g] = sum;
            }
            const double *table = tables.data() + d * width * width;
            for (int64_t g = 0; g < n_fours; ++g) {
                L sum = grown[g];
                for (int64_t m = 0; m < n_fours; ++m)
                    for (int lane = 0; lane < 4; ++lane)
                        sum = fma(L::load(table + (4 * m + lane) * width + 4 * g),
                                  L::splat(seen[m][lane]), sum);
                grown[g] = sum;
            }
        }
        const double *before_row = old + width * i;
        double total = 0.0;
        for (int64_t g = 0; g < n_fours; ++g) {
            grown[g] = largest(grown[g], zero) * L::load(before_row + 4 * g);
            total += sum_in_order(grown[g]);
        }
        support += total - 1.0;
        const bool usable = total > MIN_MASS;
        const L scale = L::splat(usable ? (1.0 - damping) / total : 0.0);
        const L kept = L::splat(usable ? damping : 1.0);
        for (int64_t g = 0; g < n_fours; ++g) {
            const L before = L::load(before_row + 4 * g);
            const L after = grown[g] * scale + before * kept;
            after.store(out + width * i + 4 * g);
            const L change = absolute(after - before);
            most = largest(change, most);
            moved = moved + change;
        }
    }
    sums[0] = highest_lane(most);
    sums[1] = sum_in_order(moved);
    sums[2] = support;
}

// Update some parts, the first to the one before the last, from `old` (N P,) into `out`.
//
// Paper eq. 4 and 5. The nodes of a part are `begin[part]` to `begin[part + 1]`. Labels are padded to
// P, a multiple of four, with beliefs of 0; `tables` (D P P,) hold `r[d, l, m]` at `(d P + m) P + l`.
// `sums` (parts, 3) are filled: largest change, sum of changes, sum of p q over labels and nodes.
struct UpdateParts {
    template <int BYTES>
    static PGM_INLINE void run(Array<const double, 1> old, Neighbours around,
                               Array<const double, 1> tables, double damping, int64_t first,
                               int64_t last, Array<const int64_t, 1> begin, int64_t width,
                               Array<double, 1> out, Array<double, 2> sums) {
        const int64_t n_fours = width / 4;
        Four<BYTES> few[4];
        std::vector<Four<BYTES>> work(n_fours > 2 ? 2 * n_fours : 0);
        for (int64_t part = first; part < last; ++part) {
            const int64_t from = begin.data()[part], to = begin.data()[part + 1];
            double *found = sums.data() + 3 * part;
            if (n_fours == 1)
                update_part<BYTES, 1>(old.data(), around, tables, damping, from, to, 1, few, out.data(),
                                      found);
            else if (n_fours == 2)
                update_part<BYTES, 2>(old.data(), around, tables, damping, from, to, 2, few, out.data(),
                                      found);
            else
                update_part<BYTES, 0>(old.data(), around, tables, damping, from, to, n_fours,
                                      n_fours > 2 ? work.data() : few, out.data(), found);
        }
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("update_parts_of_graph", pgm::variants<UpdateParts>, "old"_a, "around"_a, "tables"_a,
               "damping"_a, "first"_a, "last"_a, "begin"_a, "width"_a, "out"_a, "sums"_a);
}
