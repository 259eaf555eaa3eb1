// Sites of borders joined to openings.

#include <algorithm>
#include <compare>
#include <numeric>
#include <vector>

#include "pgm_places/kernels/registry.hpp"
#include "pgm_places/kernels/union_find.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Two numbers each in one: the segments of a site, and its row and column.
struct Site {
    int64_t pair, place;

    auto operator<=>(const Site &) const = default;
};

// For each of some sites in ascending order, the first one of its opening, as a forest.
//
// Sites of a pair that are at most `reach` rows and columns apart belong together.
std::vector<int64_t> join_sites(const std::vector<Site> &sites, int64_t reach) {
    const auto n = static_cast<int64_t>(sites.size());
    std::vector<int64_t> first(n);
    std::iota(first.begin(), first.end(), 0);
    const Array<int64_t, 1> parent(first.data(), {n});
    for (int64_t row = 0; row <= reach; ++row)
        for (int64_t column = row > 0 ? -reach : 1; column <= reach; ++column) {
            int64_t at = 0;  // of the site that is sought, which only ever goes up
            for (int64_t i = 0; i < n; ++i) {
                const Site sought = {sites[i].pair, sites[i].place + (row << 32) + column};
                while (at < n && sites[at] < sought) ++at;
                if (at == n) break;
                if (sites[at] != sought) continue;
                const int64_t a = root(parent, i), b = root(parent, at);
                parent(std::max(a, b)) = std::min(a, b);
            }
        }
    return first;
}

// Write the opening of each site (n,), in the order of pairs and places; returns their number.
//
// `segments` and `halves_rc` are (n, 2); a site may come twice.
int64_t number_openings(Array<const int32_t, 2> segments, Array<const int32_t, 2> halves_rc,
                        int64_t reach, Array<int64_t, 1> opening) {
    const auto both = [](const Array<const int32_t, 2> &numbers, int64_t i) {
        return int64_t{numbers(i, 0)} << 32 | numbers(i, 1);
    };
    std::vector<Site> sites;
    for (int64_t i = 0; i < opening.size(); ++i)
        sites.push_back({both(segments, i), both(halves_rc, i)});
    std::vector<int64_t> order(sites.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&](int64_t a, int64_t b) { return sites[a] < sites[b]; });
    std::vector<Site> known;
    for (const int64_t i : order) {
        if (known.empty() || known.back() != sites[i]) known.push_back(sites[i]);
        opening(i) = static_cast<int64_t>(known.size()) - 1;
    }
    std::vector<int64_t> number = join_sites(known, reach);
    int64_t count = 0;
    for (int64_t i = 0; i < static_cast<int64_t>(number.size()); ++i)
        number[i] = number[i] == i ? count++ : number[number[i]];
    for (int64_t &own : opening) own = number[own];
    return count;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("number_openings", number_openings, "segments"_a, "halves_rc"_a, "reach"_a,
               "opening"_a);
}
