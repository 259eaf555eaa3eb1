// Features on raw beams: differences, ratios, gaps and spread of the lengths.
//
// Every kernel reads `rho`, the planes of its tiles, and writes rows of `values`: row 321 tile + column
// holds that feature of the tile's sixteen scans. Sums of powers are taken about the first value: no
// mean lies more than sqrt(M - 1) standard deviations away from any value, so that the shift to the
// mean loses at most five of sixteen digits.

#include "pgm_places/features/_tiles.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using namespace pgm::features;
using pgm::Array;
using std::int64_t;

constexpr int N_GAPS = N_BEAMS - 1;
constexpr double RATIO_OFFSET_M = 1e-4, LEAST_LENGTH_M = 1e-9, LEAST_STD_M = 1e-6;

using Planes = Array<const double, 2>;
using Numbers = Array<const double, 1>;

// Write f2, f2_sd, f8, f8_sd, f28, f28_sd and f32.
struct SpreadFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Array<float, 2> values) {
        using L = Wide<BYTES>;
        const L zero = L::splat(0.0), one = L::splat(1.0);
        for_each_part<BYTES>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const Values<BYTES> out(values, tile, lane);
            const L pivot = beams.load(0), jump_pivot = absolute(pivot - beams.load(1));
            L before = pivot, longest = zero, jump_1 = zero, jump_2 = zero;
            L power_1 = zero, power_2 = zero, power_3 = zero, power_4 = zero;
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                const L after = beams.load(beam + 1);
                const L jump = absolute(before - after) - jump_pivot;
                jump_1 = jump_1 + jump;
                jump_2 = fma(jump, jump, jump_2);
                const L y = after - pivot, square = y * y;
                power_1 = power_1 + y;
                power_2 = power_2 + square;
                power_3 = fma(square, y, power_3);
                power_4 = fma(square, square, power_4);
                longest = largest(longest, after);
                before = after;
            }
            jump_1 = jump_1 / N_BEAMS;
            const L m1 = power_1 / N_BEAMS, m2 = power_2 / N_BEAMS, m3 = power_3 / N_BEAMS;
            const L m4 = power_4 / N_BEAMS, square = m1 * m1;
            const L variance = largest(m2 - square, zero);
            const L fourth =
                m4 - 4.0 * m1 * m3 + 6.0 * square * m2 - 3.0 * square * square;
            const L std = square_root(variance), mean = pivot + m1;
            const auto varied = std > LEAST_STD_M;
            const L kurtosis = largest(fourth, zero) / select(varied, variance * variance, one);
            const auto reaches = longest > LEAST_LENGTH_M;
            const L scale = select(reaches, longest, one);
            out.store(F2, jump_pivot + jump_1);
            out.store(F2 + 1, square_root(largest(jump_2 / N_BEAMS - jump_1 * jump_1, zero)));
            out.store(F8, mean);
            out.store(F8 + 1, std);
            out.store(F28, select(reaches, mean / scale, zero));
            out.store(F28 + 1, select(reaches, std / scale, zero));
            out.store(F32, select(varied, kurtosis, zero));
        });
    }
};

// Write f3 for each of the `cuts` (in metres, ascending) to its column.
struct CutFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Numbers cuts,
                               Array<const int64_t, 1> columns, Array<float, 2> values) {
        constexpr int W = COMPARING<BYTES>;
        using L = Wide<W>;
        for_each_part<W>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const Values<W> out(values, tile, lane);
            int64_t reached = -1;  // the cut beyond which no beam reaches, once it was computed
            for (int64_t c = 0; c < cuts.size(); ++c) {
                if (reached >= 0) {
                    out.rows.store(columns(c), out.rows.load(columns(reached)));
                    continue;
                }
                const L cut = L::splat(cuts(c));
                L longest = beams.load(0), before = smallest(longest, cut), total = L::splat(0.0);
                for (int beam = 0; beam < N_BEAMS; ++beam) {
                    const L length = beams.load(beam + 1), after = smallest(length, cut);
                    total = total + absolute(before - after);
                    longest = largest(longest, length);
                    before = after;
                }
                out.store(columns(c), total / N_BEAMS);
                if (!any_lane(longest > cut)) reached = c;
            }
        });
    }
};

// Count, lane by lane, the `n` rows of `kept` in which the condition holds, and drop the rows in which
// it holds in no lane.
template <class L, class Condition>
PGM_INLINE L count_and_keep(const Rows<L, double> &kept, int64_t &n, Condition condition) {
    L count = L::splat(0.0);
    const int64_t n_before = n;
    n = 0;
    for (int64_t k = 0; k < n_before; ++k) {
        const L value = kept.load(k);
        const auto beyond = condition(value);
        count = select(beyond, count + 1.0, count);
        kept.store(n, value);
        n += any_lane(beyond);
    }
    return count;
}

template <int BYTES>
PGM_INLINE void write_count(const Values<BYTES> &out, Wide<BYTES> count,
                            const Array<const int64_t, 2> &columns, int64_t t) {
    out.store(columns(t, 0), count);
    out.store(columns(t, 1), count / N_GAPS);
}

// Write f14 and f33 for each of the `gaps` (ascending) to `columns` (G, 2).
//
// Most rows have no lane above the smallest gap and are dropped at once; `kept` (361 rows) is scratch
// for the others.
struct GapFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Numbers gaps,
                               Array<const int64_t, 2> columns, Array<double, 2> kept,
                               Array<float, 2> values) {
        constexpr int W = COMPARING<BYTES>;
        using L = Wide<W>;
        const auto jumps = room_in<L>(kept);
        for_each_part<W>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const Values<W> out(values, tile, lane);
            L before = beams.load(0);
            int64_t n_kept = 0;
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                const L after = beams.load(beam + 1), jump = absolute(before - after);
                before = after;
                jumps.store(n_kept, jump);
                n_kept += any_lane(jump > gaps(0));
            }
            for (int64_t g = 0; g < gaps.size(); ++g) {
                const double gap = gaps(g);
                write_count(out, count_and_keep(jumps, n_kept, [&](L jump) PGM_INLINE_LAMBDA { return jump > gap; }),
                            columns, g);
            }
        });
    }
};

// Write f27 and f27_sd, and f30 and f34 for each of the `bounds` (descending).
//
// The largest bound is counted at once, the others on the rows below the second bound; `kept`
// (361 rows) is scratch for these rows.
struct RatioFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Numbers bounds,
                               Array<const int64_t, 2> columns, Array<double, 2> kept,
                               Array<float, 2> values) {
        constexpr int W = COMPARING<BYTES>;
        using L = Wide<W>;
        const auto ratios = room_in<L>(kept);
        const double largest_bound = bounds.size() > 0 ? bounds(0) : 0.0;
        const double second_bound = bounds.size() > 1 ? bounds(1) : 0.0;
        for_each_part<W>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const Values<W> out(values, tile, lane);
            L before = beams.load(0) + RATIO_OFFSET_M, after = beams.load(1) + RATIO_OFFSET_M;
            const L pivot = smallest(before, after) / largest(before, after);
            L total = L::splat(0.0), squares = total, count = total;
            int64_t n_kept = 0;
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                after = beams.load(beam + 1) + RATIO_OFFSET_M;
                const L ratio = smallest(before, after) / largest(before, after);
                before = after;
                const L apart = ratio - pivot;
                total = total + apart;
                squares = fma(apart, apart, squares);
                count = select(ratio < largest_bound, count + 1.0, count);
                ratios.store(n_kept, ratio);
                n_kept += any_lane(ratio < second_bound);
            }
            for (int64_t b = 0; b < bounds.size(); ++b) {
                const double bound = bounds(b);
                if (b > 0)
                    count = count_and_keep(ratios, n_kept, [&](L ratio) PGM_INLINE_LAMBDA { return ratio < bound; });
                write_count(out, count, columns, b);
            }
            const L mean = total / N_BEAMS;
            out.store(F27, pivot + mean);
            out.store(F27 + 1, square_root(largest(squares / N_BEAMS - mean * mean, L::splat(0.0))));
        });
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("spread_features", pgm::variants<SpreadFeatures>, "rho"_a, "n_tiles"_a, "values"_a);
    module.add("cut_features", pgm::variants<CutFeatures>, "rho"_a, "n_tiles"_a, "cuts"_a,
               "columns"_a, "values"_a);
    module.add("gap_features", pgm::variants<GapFeatures>, "rho"_a, "n_tiles"_a, "gaps"_a,
               "columns"_a, "kept"_a, "values"_a);
    module.add("ratio_features", pgm::variants<RatioFeatures>, "rho"_a, "n_tiles"_a, "bounds"_a,
               "columns"_a, "kept"_a, "values"_a);
}
