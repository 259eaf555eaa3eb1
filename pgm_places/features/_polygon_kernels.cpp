// Features on the polygon of a scan, its Fourier coefficients apart.
//
// The polygon is star-shaped about the sensor, so that sums over the triangles (sensor, vertex, next
// vertex) do not cancel; moments are taken about the sensor and shifted to the centroid in float64.
// `directions` (361, 2) holds cosine and sine of the beams' angles.

#include "pgm_places/features/_tiles.hpp"
#include "pgm_places/kernels/registry.hpp"

namespace {

using namespace pgm::features;
using pgm::Array;
using std::int64_t;

constexpr double PI = 3.141592653589793;
// Of the angle between two beams, as the mathematical library of Python gives them: its sine, and
// 4 sin^2 of its half.
constexpr double SINE = 0x1.1df0b2b89dd1ep-6, CHORD_SQUARED = 0x1.3f680a5076462p-12;
constexpr double LEAST_AREA_M2 = 1e-9, LEAST_LENGTH_M = 1e-9, HU_SCALE = 1e-12;

using Planes = Array<const double, 2>;

// Write f5, f6, f7, f31, the lengths of the `edges` and area, perimeter and centroid.
struct OutlineFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Planes directions,
                               Array<double, 2> edges, Array<double, 2> shape,
                               Array<float, 2> values) {
        using L = Wide<BYTES>;
        const L zero = L::splat(0.0), one = L::splat(1.0);
        for_each_part<BYTES>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const auto lengths = part_of<L>(edges, tile * TILE_ROWS, lane);
            const auto found = part_of<L>(shape, tile * SHAPE_ROWS, lane);
            const Values<BYTES> out(values, tile, lane);
            L before = beams.load(0);
            L x_before = before * directions(0, 0), y_before = before * directions(0, 1);
            L products = zero, first_x = zero, first_y = zero, length = zero;
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                const L after = beams.load(beam + 1);
                const L x = after * directions(beam + 1, 0), y = after * directions(beam + 1, 1);
                const L product = before * after, step = before - after;
                const L edge = square_root(fma(step, step, product * CHORD_SQUARED));
                lengths.store(beam, edge);
                length = length + edge;
                products = products + product;
                first_x = fma(product, x_before + x, first_x);
                first_y = fma(product, y_before + y, first_y);
                before = after;
                x_before = x;
                y_before = y;
            }
            const L area = products * (SINE / 2.0);
            const auto solid = area > LEAST_AREA_M2;
            const L thirds = select(solid, products * 3.0, one);
            L centre_x = first_x / thirds, centre_y = first_y / thirds;
            if (any_lane(area <= LEAST_AREA_M2)) {
                L sum_x = zero, sum_y = zero;
                for (int beam = 0; beam < N_BEAMS; ++beam) {
                    sum_x = fma(beams.load(beam), L::splat(directions(beam, 0)), sum_x);
                    sum_y = fma(beams.load(beam), L::splat(directions(beam, 1)), sum_y);
                }
                centre_x = select(solid, centre_x, sum_x / N_BEAMS);
                centre_y = select(solid, centre_y, sum_y / N_BEAMS);
            }
            found.store(AREA, area);
            found.store(PERIMETER, length);
            found.store(CENTRE_X, centre_x);
            found.store(CENTRE_Y, centre_y);
            const auto long_enough = length > LEAST_LENGTH_M;
            const L roundness = (4.0 * PI) * area / select(long_enough, length * length, one);
            out.store(F5, area);
            out.store(F5 + 1, length);
            out.store(F5 + 2, select(solid, length / select(solid, area, one), zero));
            out.store(F31, select(long_enough, roundness, zero));
        });
    }
};

// Write f9, f9_sd, f29 and f29_sd; `shape` comes from `outline_features`.
struct CentroidFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Planes directions, Planes shape,
                               Array<float, 2> values) {
        using L = Wide<BYTES>;
        const L zero = L::splat(0.0);
        for_each_part<BYTES>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            const auto given = part_of<L>(shape, tile * SHAPE_ROWS, lane);
            const Values<BYTES> out(values, tile, lane);
            const L centre_x = given.load(CENTRE_X), centre_y = given.load(CENTRE_Y);
            L pivot = zero, farthest = zero, total = zero, squares = zero;
            for (int beam = 0; beam < N_BEAMS; ++beam) {
                const L length = beams.load(beam);
                const L x = length * directions(beam, 0) - centre_x;
                const L y = length * directions(beam, 1) - centre_y;
                const L distance = square_root(fma(x, x, y * y));
                if (beam == 0) pivot = distance;
                farthest = largest(farthest, distance);
                const L apart = distance - pivot;
                total = total + apart;
                squares = fma(apart, apart, squares);
            }
            const L shift = total / N_BEAMS, mean = pivot + shift;
            const L std = square_root(largest(squares / N_BEAMS - shift * shift, zero));
            const auto spread = farthest > LEAST_LENGTH_M;
            const L scale = select(spread, farthest, L::splat(1.0));
            out.store(F9, mean);
            out.store(F9 + 1, std);
            out.store(F29, select(spread, mean / scale, zero));
            out.store(F29 + 1, select(spread, std / scale, zero));
        });
    }
};

// Moments of the area of a polygon.
template <class L> struct Moments {
    L m20, m02, m11, m30, m03, m21, m12;
};

// A vertex and the products of its coordinates.
template <class L> struct Vertex {
    L x, y, xx, yy, xy, xxy, xyy;

    PGM_INLINE Vertex(L length, double cosine, double sine) {
        x = length * cosine;
        y = length * sine;
        xx = x * x;
        yy = y * y;
        xy = x * y;
        xxy = xx * y;
        xyy = x * yy;
    }
};

// The moments about the sensor.
//
// For a triangle with corners 0, (x, y), (x', y') of doubled area c: m20 = c/12 (x^2 + x x' + x'^2),
// m30 = c/20 (x + x') (x^2 + x'^2), m21 = c/60 ((x + x')^2 (y + y') + 2 (x^2 y + x'^2 y')), and so on;
// c is the product of the two lengths times the sine of the angle between them.
template <class L>
PGM_INLINE Moments<L> moments_about_sensor(const Rows<L, const double> &rho,
                                           const Planes &directions) {
    L before = rho.load(0);
    Vertex<L> last(before, directions(0, 0), directions(0, 1));
    L m20 = L::splat(0.0), m02 = m20, m11 = m20, m30 = m20, m03 = m20, m21 = m20, m12 = m20;
    for (int beam = 1; beam <= N_BEAMS; ++beam) {
        const L after = rho.load(beam), c = before * after;
        const Vertex<L> next(after, directions(beam, 0), directions(beam, 1));
        const L sx = last.x + next.x, sy = last.y + next.y, sxx = sx * sx, syy = sy * sy;
        const L xx_both = last.xx + next.xx, yy_both = last.yy + next.yy;
        m20 = fma(c, sxx + xx_both, m20);
        m02 = fma(c, syy + yy_both, m02);
        m11 = fma(c, fma(sx, sy, last.xy + next.xy), m11);
        m30 = fma(c * sx, xx_both, m30);
        m03 = fma(c * sy, yy_both, m03);
        m21 = fma(c, fma(sxx, sy, 2.0 * (last.xxy + next.xxy)), m21);
        m12 = fma(c, fma(syy, sx, 2.0 * (last.xyy + next.xyy)), m12);
        before = after;
        last = next;
    }
    return {m20 * (SINE / 24.0), m02 * (SINE / 24.0), m11 * (SINE / 24.0), m30 * (SINE / 20.0),
            m03 * (SINE / 20.0), m21 * (SINE / 60.0), m12 * (SINE / 60.0)};
}

// The logarithm of an invariant, with its sign.
inline float level(double h) {
    const double size = std::log10(1.0 + std::fabs(h) / HU_SCALE);
    return static_cast<float>(h >= 0.0 ? size : -size);
}

// Write Hu's seven invariants as f21[1..7], and f22 and f23.
template <int BYTES, class L>
PGM_INLINE void write_invariants(const Rows<L, const double> &shape, const Moments<L> &m,
                                 const Values<BYTES> &out) {
    const L zero = L::splat(0.0), one = L::splat(1.0);
    const L area = shape.load(AREA), cx = shape.load(CENTRE_X), cy = shape.load(CENTRE_Y);
    const auto solid = area > LEAST_AREA_M2;
    const L safe = select(solid, area, one), second = safe * safe;
    const L third = second * square_root(safe);
    const L e20 = (m.m20 - area * cx * cx) / second;
    const L e02 = (m.m02 - area * cy * cy) / second;
    const L e11 = (m.m11 - area * cx * cy) / second;
    const L e30 = (m.m30 - cx * (3.0 * m.m20 - 2.0 * area * cx * cx)) / third;
    const L e03 = (m.m03 - cy * (3.0 * m.m02 - 2.0 * area * cy * cy)) / third;
    const L e21 = (m.m21 - 2.0 * cx * (m.m11 - area * cx * cy) - cy * m.m20) / third;
    const L e12 = (m.m12 - 2.0 * cy * (m.m11 - area * cx * cy) - cx * m.m02) / third;
    const L p = e30 + e12, q = e21 + e03, r = e30 - 3.0 * e12, s = 3.0 * e21 - e03;
    const L pp = p * p, qq = q * q, apart = e20 - e02;
    const L spread = apart * apart + 4.0 * e11 * e11;
    const L u = p * (pp - 3.0 * qq), v = q * (3.0 * pp - qq);
    const L invariants[] = {e20 + e02,
                            spread,
                            r * r + s * s,
                            pp + qq,
                            r * u + s * v,
                            apart * (pp - qq) + 4.0 * e11 * p * q,
                            s * u - r * v};
    for (int k = 0; k < 7; ++k) {
        const L invariant = select(solid, invariants[k], zero);
        out.rows.store(F21 + k,
                       Narrow<BYTES>::every([&](int lane) { return level(invariant[lane]); }));
    }
    const L trace = select(solid, e20 + e02, one);
    const L compactness = L::splat(1.0 / (2.0 * PI)) / trace;
    out.store(F21 + 7, select(solid, compactness, zero));
    out.store(F21 + 8, select(solid, square_root(spread) / trace, zero));
}

// Write f21[1..7], f22 and f23.
struct MomentFeatures {
    template <int BYTES>
    static PGM_INLINE void run(Planes rho, int64_t n_tiles, Planes directions, Planes shape,
                               Array<float, 2> values) {
        using L = Wide<BYTES>;
        for_each_part<BYTES>(n_tiles, [&](int64_t tile, int lane) PGM_INLINE_LAMBDA {
            const auto beams = part_of<L>(rho, tile * TILE_ROWS, lane);
            write_invariants(part_of<L>(shape, tile * SHAPE_ROWS, lane),
                             moments_about_sensor(beams, directions),
                             Values<BYTES>(values, tile, lane));
        });
    }
};

}  // namespace

PGM_KERNELS(module) {
    module.add("outline_features", pgm::variants<OutlineFeatures>, "rho"_a, "n_tiles"_a,
               "directions"_a, "edges"_a, "shape"_a, "values"_a);
    module.add("centroid_features", pgm::variants<CentroidFeatures>, "rho"_a, "n_tiles"_a,
               "directions"_a, "shape"_a, "values"_a);
    module.add("moment_features", pgm::variants<MomentFeatures>, "rho"_a, "n_tiles"_a,
               "directions"_a, "shape"_a, "values"_a);
}
