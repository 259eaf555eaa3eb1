// Which cells of a piece are farthest from its edge.

#include <algorithm>

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;
using std::int32_t;
using std::int64_t;

// Write whether each cell is as deep as any of its piece; `most` (R,) is -1 on entry.
void mark_deepest(Array<const int32_t, 2> piece, Array<const int32_t, 2> depth,
                  Array<int32_t, 1> most, Array<bool, 2> found) {
    const int32_t *own = piece.data(), *deep = depth.data();
    for (int64_t i = 0; i < piece.size(); ++i)
        if (own[i] >= 0) most(own[i]) = std::max(most(own[i]), deep[i]);
    for (int64_t i = 0; i < piece.size(); ++i)
        found.data()[i] = own[i] >= 0 && deep[i] == most(own[i]);
}

}  // namespace

PGM_KERNELS(module) {
    module.add("mark_deepest", mark_deepest, "piece"_a, "depth"_a, "most"_a, "found"_a);
}
