// Connected components in two passes over the raster (Rosenfeld and Pfaltz, 1966).

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// The smallest of the numbers that have been joined to one.
int32_t root_of(int32_t *parent, int32_t number) {
    while (parent[number] != number) {
        parent[number] = parent[parent[number]];
        number = parent[number];
    }
    return number;
}

// Number of pieces; writes the piece of each cell, -1 where the label is negative.
//
// `parent` is scratch for one entry per provisional number, at most one per cell. Pieces are numbered
// in the order of their first cell, because a root is the smallest of its numbers.
template <class Label>
int64_t label_components(Array<const Label, 2> labels, bool eight, Array<int32_t, 1> parents,
                         Array<int32_t, 2> piece) {
    const int64_t height = labels.shape(0), width = labels.shape(1);
    int32_t *parent = parents.data(), count = 0;
    for (int64_t r = 0; r < height; ++r)
        for (int64_t c = 0; c < width; ++c) {
            const Label label = labels(r, c);
            if (label < 0) {
                piece(r, c) = -1;
                continue;
            }
            int32_t own = c > 0 && labels(r, c - 1) == label ? piece(r, c - 1) : -1;
            if (r > 0) {
                const int64_t first = eight && c > 0 ? c - 1 : c;
                const int64_t last = eight && c + 1 < width ? c + 1 : c;
                for (int64_t d = first; d <= last; ++d) {
                    const int32_t above = piece(r - 1, d);
                    if (labels(r - 1, d) != label || above == own) continue;
                    if (own < 0) {
                        own = above;
                        continue;
                    }
                    const int32_t a = root_of(parent, own), b = root_of(parent, above);
                    own = a < b ? a : b;
                    parent[a < b ? b : a] = own;
                }
            }
            if (own < 0) {
                own = count;
                parents(count) = count;
                ++count;
            }
            piece(r, c) = own;
        }
    int32_t n_pieces = 0;
    for (int32_t number = 0; number < count; ++number)
        parent[number] = parent[number] == number ? n_pieces++ : parent[parent[number]];
    for (int32_t &number : piece)
        if (number >= 0) number = parent[number];
    return n_pieces;
}

}  // namespace

PGM_KERNELS(module) {
    module.add("label_components", label_components<std::int8_t>, "labels"_a, "eight"_a, "parent"_a,
               "piece"_a);
    module.add("label_components", label_components<std::int16_t>, "labels"_a, "eight"_a, "parent"_a,
               "piece"_a);
    module.add("label_components", label_components<int32_t>, "labels"_a, "eight"_a, "parent"_a,
               "piece"_a);
}
