// The exact Fourier series of a scan's outline: f16 to f19_2.
//
// With u_k the unit vector along edge k, a_k = u_{k-1} - u_k the turn at vertex k, and
// w_k = exp(-i theta_k), theta_k = 2 pi t_k / L the vertex's place along the outline,
//
//     c_n = L / (2 pi n)^2 * sum_k a_k w_k^n .
//
// Orders are reached from the centres c = 0, +-29, +-58, +-87 by the steps s = 0..14: with
// a_k w_k^c = A_k the four real sums of the products of Re A, Im A with cos(s theta) and sin(s theta)
// give both c_{c+s} and c_{c-s}, so that an order costs two products a vertex and little more than two
// powers are formed for ten orders. A pair (centre, step) is a *cell*.
//
// Vertices are handled in chunks that stay in the first-level cache. Positions along the outline are
// float64, as are the sums of the orders 1 and -1, by which all others are divided; the cells' sums are
// float32.

#include "pgm_places/features/_tiles.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using namespace pgm::features;
using pgm::Array;
using std::int64_t;

constexpr int CHUNK = 12, REACH = 14, N_STEPS = REACH + 1;
constexpr double PI = 3.141592653589793, LEAST_EDGE_M = 1e-12, LEAST_LENGTH_M = 1e-9;

// Rows of the float32 planes to work in, real parts or cosines before imaginary parts or sines: the
// sides u_k of the outline; of a chunk the turns a_k, the steps, the turns times one centre's
// power and times its conjugate, that power, and the power from centre to centre.
constexpr int SIDES = 0, TURNS = SIDES + 2 * N_BEAMS, STEPS = TURNS + 2 * CHUNK,
              CENTRES = STEPS + 2 * N_STEPS * CHUNK, POWER = CENTRES + 4 * CHUNK,
              STRIDE = POWER + 2 * CHUNK, WORK_ROWS = STRIDE + 2 * CHUNK;
constexpr int SUM_ROWS = 4 * 7 * N_STEPS;  // four sums for each cell; seven centres reach order 100

// Tiles as the kernels on polygons take them.
struct Outline {
    Array<const double, 2> rho, directions;
    Array<const double, 2> edges, shape;  // from `outline_features`
    auto fields() { return std::tie(rho, directions, edges, shape); }
};

// The cells that the wanted orders need: `FourierPlan` in laser.py.
struct Plan {
    int64_t n_steps;
    Array<const int64_t, 1> bounds, steps;
    Array<const int64_t, 2> orders;
    auto fields() { return std::tie(n_steps, bounds, steps, orders); }
};

template <int BYTES> struct Series {
    using D = Wide<BYTES>;
    using F = Narrow<BYTES>;
    using Beams = Rows<D, const double>;

    // Cells whose sums the processor's registers hold at once.
    static constexpr int AT_ONCE = BYTES == 64 ? 5 : 3;

    Rows<F, float> work, sums;

    // Of the orders 1 and -1: the place along the outline, then the sums of Re a cos, Im a sin,
    // Im a cos, Re a sin of theta.
    D place, re_cos, im_sin, im_cos, re_sin;

    // Write the unit vectors along the edges; 0 for an edge without length.
    PGM_INLINE void write_sides(const Beams &rho, const Beams &edges,
                                const Array<const double, 2> &directions) const {
        const D before = rho.load(0);
        D x_before = before * directions(0, 0), y_before = before * directions(0, 1);
        for (int beam = 0; beam < N_BEAMS; ++beam) {
            const D after = rho.load(beam + 1), edge = edges.load(beam);
            const D x = after * directions(beam + 1, 0), y = after * directions(beam + 1, 1);
            const auto seen = edge > LEAST_EDGE_M;
            const F scale = F::splat(1.0f) / narrow(select(seen, edge, D::splat(1e30)));
            work.store(SIDES + beam, narrow(x - x_before) * scale);
            work.store(SIDES + N_BEAMS + beam, narrow(y - y_before) * scale);
            x_before = x;
            y_before = y;
        }
    }

    // sin(pi x) for |x| <= 1/2, error below 3e-11.
    static PGM_INLINE D sine(D x) {
        const D y = x * x;
        D p = fma(y, D::splat(-0.007028386369347573), D::splat(0.08205040178581838));
        p = fma(y, p, D::splat(-0.599252197819169));
        p = fma(y, p, D::splat(2.5501633189466246));
        p = fma(y, p, D::splat(-5.167712764624521));
        return x * fma(y, p, D::splat(3.14159265353629));
    }

    // cos(pi x) for |x| <= 1/2, error below 3e-10.
    static PGM_INLINE D cosine(D x) {
        const D y = x * x;
        D p = fma(y, D::splat(-0.02439632429741323), D::splat(0.23493731378366647));
        p = fma(y, p, D::splat(-1.3352120030432615));
        p = fma(y, p, D::splat(4.058709159555605));
        p = fma(y, p, D::splat(-4.934802137078794));
        return fma(y, p, D::splat(0.9999999997799038));
    }

    // Write turns and first powers of a chunk, and the stride from centre to centre if deep.
    PGM_INLINE void add_first_orders(const Beams &edges, int start, D inverse_length, bool deep) {
        const int before = start > 0 ? start - 1 : N_BEAMS - 1;
        F u_before = work.load(SIDES + before), v_before = work.load(SIDES + N_BEAMS + before);
        for (int i = 0; i < CHUNK; ++i) {
            const F u = work.load(SIDES + start + i), v = work.load(SIDES + N_BEAMS + start + i);
            work.store(TURNS + i, u_before - u);
            work.store(TURNS + CHUNK + i, v_before - v);
            const D re = widen(u_before) - widen(u), im = widen(v_before) - widen(v);
            u_before = u;
            v_before = v;
            const D turns = place * inverse_length;
            place = place + edges.load(start + i);
            // Half of theta, less a quarter turn, lies between -1/2 and 1/2 times pi.
            const D half_sin = cosine(turns - 0.5);
            const D minus_half_cos = sine(turns - 0.5);
            const D cos = fma(half_sin * -2.0, half_sin, D::splat(1.0));
            const D sin = half_sin * minus_half_cos * -2.0;
            re_cos = fma(re, cos, re_cos);
            im_sin = fma(im, sin, im_sin);
            im_cos = fma(im, cos, im_cos);
            re_sin = fma(re, sin, re_sin);
            work.store(STEPS + 2 * CHUNK + i, narrow(cos));
            work.store(STEPS + 3 * CHUNK + i, narrow(sin));
            if (deep) write_stride(turns, i);
        }
    }

    PGM_INLINE void write_stride(D turns, int i) const {
        D x = turns * (2.0 * REACH + 1.0);
        x = x - nearest_integer(x);
        const F half_sin = narrow(sine(x)), half_cos = narrow(cosine(x));
        const F cos = fma(half_sin * -1.0f, half_sin * 2.0f, F::splat(1.0f));
        const F sin = half_sin * half_cos * 2.0f;
        work.store(STRIDE + i, cos);
        work.store(STRIDE + CHUNK + i, sin);
        work.store(POWER + i, cos);
        work.store(POWER + CHUNK + i, sin);
    }

    // Write cosine and sine of 2 theta to n_steps theta for a chunk.
    PGM_INLINE void write_steps(int64_t n_steps) const {
        for (int i = 0; i < CHUNK; ++i) {
            const F c1 = work.load(STEPS + 2 * CHUNK + i), s1 = work.load(STEPS + 3 * CHUNK + i);
            F c = c1, s = s1;
            for (int64_t step = 2; step <= n_steps; ++step) {
                const F t = fma(s, c1, c * s1);
                c = fma(c, c1, s * s1 * -1.0f);
                s = t;
                work.store(STEPS + 2 * step * CHUNK + i, c);
                work.store(STEPS + (2 * step + 1) * CHUNK + i, s);
            }
        }
    }

    // Write a_k w_k^c and a_k w_k^-c of a chunk; move the power on to the next centre.
    PGM_INLINE void write_centre() const {
        for (int i = 0; i < CHUNK; ++i) {
            const F turn_re = work.load(TURNS + i), turn_im = work.load(TURNS + CHUNK + i);
            const F c = work.load(POWER + i), s = work.load(POWER + CHUNK + i);
            const F rc = turn_re * c, is = turn_im * s, ic = turn_im * c, rs = turn_re * s;
            work.store(CENTRES + i, rc + is);
            work.store(CENTRES + CHUNK + i, ic - rs);
            work.store(CENTRES + 2 * CHUNK + i, rc - is);
            work.store(CENTRES + 3 * CHUNK + i, ic + rs);
            const F c1 = work.load(STRIDE + i), s1 = work.load(STRIDE + CHUNK + i);
            work.store(POWER + i, fma(c, c1, s * s1 * -1.0f));
            work.store(POWER + CHUNK + i, fma(s, c1, c * s1));
        }
    }

    // Add a chunk to COUNT cells of one centre, whose sums stay in registers.
    template <int COUNT> PGM_INLINE void sum_cells(int centre, int64_t cell, const int64_t *steps) const {
        F p[COUNT], q[COUNT], u[COUNT], v[COUNT];
        const float *cosines[COUNT];
#pragma GCC unroll 5
        for (int k = 0; k < COUNT; ++k) {
            p[k] = q[k] = u[k] = v[k] = F::splat(0.0f);
            cosines[k] = work.data + (STEPS + 2 * CHUNK * steps[k]) * work.stride;
        }
        for (int i = 0; i < CHUNK; ++i) {
            const F re = work.load(centre + i), im = work.load(centre + CHUNK + i);
#pragma GCC unroll 5
            for (int k = 0; k < COUNT; ++k) {
                const F c = F::load(cosines[k] + i * work.stride);
                const F s = F::load(cosines[k] + (CHUNK + i) * work.stride);
                p[k] = fma(re, c, p[k]);
                q[k] = fma(im, s, q[k]);
                u[k] = fma(im, c, u[k]);
                v[k] = fma(re, s, v[k]);
            }
        }
#pragma GCC unroll 5
        for (int k = 0; k < COUNT; ++k) {
            sums.add(4 * (cell + k), p[k]);
            sums.add(4 * (cell + k) + 1, q[k]);
            sums.add(4 * (cell + k) + 2, u[k]);
            sums.add(4 * (cell + k) + 3, v[k]);
        }
    }

    // Add a chunk to all cells: those of centre row r are bounds[r]..bounds[r + 1] - 1.
    PGM_INLINE void sum_all_cells(const Plan &plan) const {
        for (int64_t row = 0; row + 1 < plan.bounds.size(); ++row) {
            if (row % 2 == 1) write_centre();
            const int centre = row == 0 ? TURNS : row % 2 == 1 ? CENTRES : CENTRES + 2 * CHUNK;
            int64_t cell = plan.bounds(row);
            const int64_t end = plan.bounds(row + 1);
            const int64_t *steps = plan.steps.data();
            for (; cell + AT_ONCE <= end; cell += AT_ONCE)
                sum_cells<AT_ONCE>(centre, cell, steps + cell);
            for (; cell + 2 <= end; cell += 2) sum_cells<2>(centre, cell, steps + cell);
            if (cell < end) sum_cells<1>(centre, cell, steps + cell);
        }
    }

    // Write f16 to f19_2 from the sums.
    PGM_INLINE void write_orders(D length, const Plan &plan, const Values<BYTES> &out) const {
        const D zero = D::splat(0.0), one = D::splat(1.0);
        const D plus_re = re_cos + im_sin, plus_im = im_cos - re_sin;
        const D minus_re = re_cos - im_sin, minus_im = im_cos + re_sin;
        const D plus = square_root(plus_re * plus_re + plus_im * plus_im);
        const D minus = square_root(minus_re * minus_re + minus_im * minus_im);
        const D scale = length * (0.25 / (PI * PI));
        const auto usable = plus * scale > LEAST_LENGTH_M;
        const D safe = select(usable, plus, one);
        const D major = plus + minus, minor = absolute(plus - minus);
        const D axes = select(usable, minor / select(usable, major, one), zero);
        out.store(F17, major * scale);
        out.store(F17 + 1, minor * scale);
        out.store(F17 + 2, axes);
        out.store(F17 + 3, select(usable, major / safe, zero));
        out.store(F17 + 4, select(usable, minor / safe, zero));
        out.store(F17 + 5, axes);
        const F inverse = narrow(select(usable, one / safe, zero));
        for (int64_t o = 0; o < plan.orders.shape(0); ++o) {
            const int64_t n = plan.orders(o, 0), cell = 4 * plan.orders(o, 1);
            const int64_t column = plan.orders(o, 3);
            if (n == -1) {
                out.store(column, select(usable, minus / safe, zero));
                continue;
            }
            const F p = sums.load(cell), q = sums.load(cell + 1);
            const F u = sums.load(cell + 2), v = sums.load(cell + 3);
            const auto sign = static_cast<float>(plan.orders(o, 2));
            const F re = p + q * sign, im = u - v * sign;
            const F size = square_root(fma(re, re, im * im));
            const auto square = static_cast<double>(n * n);
            out.rows.store(column, size * (inverse * static_cast<float>(1.0 / square)));
        }
    }

    PGM_INLINE void clear(int64_t n_cells) {
        place = re_cos = im_sin = im_cos = re_sin = D::splat(0.0);
        for (int64_t row = 0; row < 4 * n_cells; ++row) sums.store(row, F::splat(0.0f));
    }

    // The series of a part of a tile.
    PGM_INLINE void run(const Outline &outline, int64_t tile, int lane, const Plan &plan,
                        const Values<BYTES> &out) {
        const Beams edges = part_of<D>(outline.edges, tile * TILE_ROWS, lane);
        write_sides(part_of<D>(outline.rho, tile * TILE_ROWS, lane), edges, outline.directions);
        clear(plan.steps.size());
        const D length = part_of<D>(outline.shape, tile * SHAPE_ROWS, lane).load(PERIMETER);
        const D one = D::splat(1.0);
        const D inverse_length = one / select(length > LEAST_LENGTH_M, length, one);
        for (int start = 0; start < N_BEAMS; start += CHUNK) {
            add_first_orders(edges, start, inverse_length, plan.bounds.size() > 2);
            write_steps(plan.n_steps);
            sum_all_cells(plan);
        }
        write_orders(length, plan, out);
    }
};

// Write f17 to f19_2, and f16 for each of the plan's orders.
//
// `work` (rows, 16) is memory to work in.
struct FourierFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Outline outline, int64_t n_tiles, Plan plan, Array<float, 2> work,
                               Array<float, 2> values) {
        using F = Narrow<BYTES>;
        Series<BYTES> series;
        series.work = room_in<F>(work);
        series.sums = series.work;
        series.sums.data += WORK_ROWS * LANES;
        for (int i = 0; i < CHUNK; ++i) {
            series.work.store(STEPS + i, F::splat(1.0f));
            series.work.store(STEPS + CHUNK + i, F::splat(0.0f));
        }
        for_each_part<BYTES>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            series.run(outline, tile, lane, plan, Values<BYTES>(values, tile, lane));
        });
    }
};

// How many rows of sixteen numbers `fourier_features` works in.
int64_t fourier_rows() { return WORK_ROWS + SUM_ROWS; }

}  // namespace

PGM_KERNELS(module) {
    module.add("fourier_features", pgm::variants<FourierFeatures>, "outline"_a, "n_tiles"_a,
               "plan"_a, "work"_a, "values"_a);
    module.add("fourier_rows", fourier_rows);
}
