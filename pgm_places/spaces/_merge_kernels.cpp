// Merging basins across wide passes (union-find over the passes, widest first).

#include <algorithm>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/kernels/union_find.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Growing segments; only roots have a valid radius and area.
struct Segments {
    Array<int32_t, 1> parent;
    Array<double, 1> radius;
    Array<int64_t, 1> area;

    int32_t of(int32_t basin) const { return root(parent, basin); }

    void join(int32_t a, int32_t b) const {
        a = of(a);
        b = of(b);
        if (a == b) return;
        const int32_t low = std::min(a, b), high = std::max(a, b);
        parent(high) = low;
        radius(low) = std::max(radius(low), radius(high));
        area(low) += area(high);
    }
};

// For each small segment, the large one to join; none if several are equally good.
struct Choices {
    std::vector<int32_t> chosen;
    std::vector<char> tied;

    explicit Choices(int64_t n) : chosen(n, -1), tied(n, false) {}

    void offer(const Segments &segments, int32_t small, int32_t large) {
        const int32_t best = chosen[small];
        if (best < 0) {
            chosen[small] = large;
        } else if (large != best) {
            const double more = segments.radius(large), most = segments.radius(best);
            const int64_t area = segments.area(large), largest = segments.area(best);
            if (more > most || (more == most && area > largest)) {
                chosen[small] = large;
                tied[small] = false;
            } else if (more == most && area == largest) {
                tied[small] = true;
            }
        }
    }

    // What a segment has chosen, or -1; it may choose again.
    int32_t take(int32_t small) {
        const int32_t best = tied[small] ? -1 : chosen[small];
        chosen[small] = -1;
        tied[small] = false;
        return best;
    }
};

// Write for each basin the smallest number among the basins that it is merged with.
//
// `pairs` (E, 2) are sorted by decreasing `half_width`. `radius` and `area` (B,) of the basins are
// overwritten. Passes of equal width are processed together: at that width a segment is small if its
// radius is under width / ratio (or `least_radius`). Adjacent small segments join each other; each
// result then joins the adjacent large segment with the largest radius, then area, or none if these
// are tied. The outcome does not depend on any order.
void merge_basins(Array<const int32_t, 2> pairs, Array<const double, 1> half_width,
                  Array<double, 1> radius, Array<int64_t, 1> area, double ratio,
                  double least_radius, Array<int32_t, 1> parent) {
    const Segments segments = {parent, radius, area};
    Choices choices(parent.size());
    for (int64_t i = 0; i < parent.size(); ++i) parent(i) = static_cast<int32_t>(i);
    for (int64_t begin = 0, end = 0; begin < pairs.shape(0); begin = end) {
        while (end < pairs.shape(0) && half_width(end) == half_width(begin)) ++end;
        const double small = std::max(half_width(begin) / ratio, least_radius);
        for (int64_t e = begin; e < end; ++e) {
            const int32_t a = segments.of(pairs(e, 0)), b = segments.of(pairs(e, 1));
            if (radius(a) < small && radius(b) < small) segments.join(a, b);
        }
        for (int64_t e = begin; e < end; ++e) {
            int32_t a = segments.of(pairs(e, 0)), b = segments.of(pairs(e, 1));
            if (radius(a) >= small) std::swap(a, b);
            if (!(radius(a) >= small || radius(b) < small)) choices.offer(segments, a, b);
        }
        // The roots of small segments stay unchanged until all have chosen.
        for (int64_t e = begin; e < end; ++e)
            for (int side = 0; side < 2; ++side) {
                const int32_t a = segments.of(pairs(e, side)), best = choices.take(a);
                if (best >= 0) segments.join(a, best);
            }
    }
    for (int64_t i = 0; i < parent.size(); ++i) parent(i) = segments.of(static_cast<int32_t>(i));
}

}  // namespace

PGM_KERNELS(module) {
    module.add("merge_basins", merge_basins, "pairs"_a, "half_width"_a, "radius"_a, "area"_a,
               "ratio"_a, "least_radius"_a, "parent"_a);
}
