// f25 and f26: where the two deepest minima of a scan lie.
//
// Seen from the global minimum, beam j lies behind the barrier b_j = min(L_j, R_j) - rho_j, L_j and R_j
// being the longest beams on the way there on either side. The second minimum for the prominence d is
// the lowest beam with b_j >= d; of several equally low ones that with the smallest angle to the first.
// The first minimum is the middle of its run of equal beams (the run that is met first, if there are
// several).

#include "pgm_places/features/_tiles.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using namespace pgm::features;
using pgm::Array;
using std::int64_t;

constexpr double STEP_RAD = 2.0 * 3.141592653589793 / N_BEAMS, UNREACHED_M = 1e300;

// The prominences (P,), ascending, and the columns (P, 2) that f25 and f26 go to.
struct Minima {
    Array<const double, 1> prominences;
    Array<const int64_t, 2> columns;
    auto fields() { return std::tie(prominences, columns); }
};

// Planes to work in.
struct Room {
    Array<double, 2> ahead, kept;  // 361 rows
    Array<int64_t, 1> beams;       // 361 integers
    auto fields() { return std::tie(ahead, kept, beams); }
};

// The first minimum: its length, its first beam, the middle of its run.
template <class L> struct First {
    L lowest, start, middle;
};

// The longest beams before the first minimum, and from it to the end of the scan.
template <class L> struct Longest {
    L before, at_the_end;
};

// Beams that may be second minima in some lane: their barriers are the first rows of `barriers`.
template <class L> struct Candidates {
    Rows<L, double> barriers;
    int64_t *beams;
    int64_t n = 0;

    PGM_INLINE void keep(L barrier, int64_t beam, bool wanted) {
        barriers.store(n, barrier);
        beams[n] = beam;
        n += wanted;
    }
};

template <class L> using Beams = Rows<L, const double>;

template <class L> PGM_INLINE First<L> first_minimum(const Beams<L> &rho) {
    L lowest = rho.load(0);
    for (int beam = 1; beam < N_BEAMS; ++beam) lowest = smallest(rho.load(beam), lowest);
    // First and last beam of the first and of the last run of beams of that length.
    L start = L::splat(-1.0), end = start, last_start = start, last_end = L::splat(-2.0);
    for (int beam = 0; beam < N_BEAMS; ++beam) {
        const auto tied = rho.load(beam) == lowest;
        if (!any_lane(tied)) continue;
        const L here = L::splat(beam), before = here - 1.0;
        start = select(tied & (start < 0.0), here, start);
        end = select(tied & ((end < 0.0) | (end == before)), here, end);
        last_start = select(tied & (last_end != before), here, last_start);
        last_end = select(tied, here, last_end);
    }
    const auto wraps = (start == 0.0) & (last_end == N_BEAMS - 1.0);
    const L middle = (select(wraps, last_start - N_BEAMS, start) + end) / 2.0;
    return {lowest, start, select(middle < 0.0, middle + N_BEAMS, middle)};
}

// Write the longest beam from the first minimum up to each beam to `ahead`.
//
// Rows before the first minimum lack the beams from it to the end of the scan.
template <class L>
PGM_INLINE Longest<L> longest_ahead(const Beams<L> &rho, L start, const Rows<L, double> &ahead) {
    L longest = L::splat(0.0), before = longest;
    for (int beam = 0; beam < N_BEAMS; ++beam) {
        const L length = rho.load(beam);
        const auto here = start == beam;
        before = select(here, longest, before);
        longest = select(here, length, largest(longest, length));
        ahead.store(beam, longest);
    }
    return {before, longest};
}

// Set aside the beams that may be second minima in some lane.
//
// Barriers are -1 in the lanes where the beam is no local minimum (a beam with a lower neighbour is
// never the lowest behind a barrier).
template <class L>
PGM_INLINE void keep_candidates(const Beams<L> &rho, double least, L start, const Longest<L> &longest,
                                const Rows<L, double> &ahead, Candidates<L> &kept) {
    L behind = longest.before, after = rho.load(0), length = rho.load(N_BEAMS - 1);
    for (int beam = N_BEAMS - 1; beam >= 0; --beam) {
        const L before = rho.load(beam > 0 ? beam - 1 : N_BEAMS - 1);
        behind = select(start == beam + 1.0, length, largest(behind, length));
        L so_far = ahead.load(beam);
        so_far = select(start > beam, largest(so_far, longest.at_the_end), so_far);
        const auto low = (length <= before) & (length <= after);
        const L barrier = select(low, smallest(so_far, behind) - length, L::splat(-1.0));
        kept.keep(barrier, beam, any_lane(barrier >= least));
        after = length;
        length = before;
    }
}

// Drop candidates that cannot be lowest for any prominence.
//
// Behind a barrier of `most`, the largest prominence, a beam competes for every prominence, so that
// in its lane no longer beam can win.
template <class L>
PGM_INLINE void drop_dominated(const Beams<L> &rho, double least, double most, Candidates<L> &kept) {
    const L nowhere = L::splat(UNREACHED_M);
    L deepest = nowhere;
    for (int64_t k = 0; k < kept.n; ++k)
        deepest = smallest(deepest, select(kept.barriers.load(k) >= most,
                                           rho.load(kept.beams[k]), nowhere));
    const int64_t n_before = kept.n;
    kept.n = 0;
    for (int64_t k = 0; k < n_before; ++k) {
        const int64_t beam = kept.beams[k];
        const L barrier =
            select(rho.load(beam) <= deepest, kept.barriers.load(k), L::splat(-1.0));
        kept.keep(barrier, beam, any_lane(barrier >= least));
    }
}

// Write f25 and f26 for each prominence.
//
// `chords` (361,) holds 4 sin(a / 2)^2 of the angle of each number of half beams.
struct MinimaFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Array<const double, 2> planes, int64_t n_tiles, Minima minima,
                               Array<const double, 1> chords, Room room, Array<float, 2> values) {
        constexpr int W = COMPARING<BYTES>;
        using L = Wide<W>;
        const auto &prominences = minima.prominences;
        const L zero = L::splat(0.0), nowhere = L::splat(UNREACHED_M);
        const auto ahead = room_in<L>(room.ahead);
        const double least = prominences(0), most = prominences(prominences.size() - 1);
        for_each_part<W>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const Beams<L> rho = part_of<L>(planes, tile * TILE_ROWS, lane);
            const Values<W> out(values, tile, lane);
            const First<L> first = first_minimum(rho);
            const Longest<L> longest = longest_ahead(rho, first.start, ahead);
            Candidates<L> kept{room_in<L>(room.kept), room.beams.data()};
            keep_candidates(rho, least, first.start, longest, ahead, kept);
            drop_dominated(rho, least, most, kept);
            for (int64_t p = 0; p < prominences.size(); ++p) {
                const double prominence = prominences(p);
                L second = nowhere, offset = nowhere;
                const int64_t n_before = kept.n;
                kept.n = 0;
                for (int64_t k = 0; k < n_before; ++k) {
                    const L barrier = kept.barriers.load(k);
                    const int64_t beam = kept.beams[k];
                    const auto hidden = barrier >= prominence;
                    second = smallest(second, select(hidden, rho.load(beam), nowhere));
                    kept.keep(barrier, beam, any_lane(hidden));
                }
                for (int64_t k = 0; k < kept.n; ++k) {
                    const auto equal = (rho.load(kept.beams[k]) == second) &
                                       (kept.barriers.load(k) >= prominence);
                    L apart = absolute(first.middle - static_cast<double>(kept.beams[k]));
                    apart = smallest(apart, L::splat(N_BEAMS) - apart);
                    offset = smallest(offset, select(equal, apart, nowhere));
                }
                const auto seen = second < nowhere;
                offset = select(seen, offset, zero);
                const L chord =
                    L::every([&](int i) { return chords(static_cast<int64_t>(2.0 * offset[i])); });
                second = select(seen, second, first.lowest);
                const L drop = second - first.lowest;
                const L distance = square_root(drop * drop + first.lowest * second * chord);
                out.store(minima.columns(p, 0), select(seen, distance, zero));
                out.store(minima.columns(p, 1), select(seen, offset * STEP_RAD, zero));
            }
        });
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("minima_features", pgm::variants<MinimaFeatures>, "rho"_a, "n_tiles"_a, "minima"_a,
               "chords"_a, "room"_a, "values"_a);
}
