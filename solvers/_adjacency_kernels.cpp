// The kernel that lays out the arcs of a graph.

#include "pgm_places/kernels/registry.hpp"

namespace {

using pgm::Array;

// Write both arcs of every edge into the rows of their owners, and where each row begins.
//
// `next_slot` (N,) must be 0; it is used up.
void fill_slots(Array<const std::uint32_t, 2> edges, Array<std::uint32_t, 1> next_slot,
                Array<std::uint32_t, 1> start, Array<std::uint32_t, 1> head,
                Array<std::uint32_t, 1> arc) {
    const std::int64_t n_edges = edges.shape(0), n_nodes = next_slot.shape(0);
    for (std::int64_t e = 0; e < n_edges; ++e) {
        next_slot(edges(e, 0)) += 1;
        next_slot(edges(e, 1)) += 1;
    }
    std::uint32_t n_slots = 0;
    for (std::int64_t i = 0; i < n_nodes; ++i) {
        start(i) = n_slots;
        n_slots += next_slot(i);
        next_slot(i) = start(i);
    }
    start(n_nodes) = n_slots;
    for (std::int64_t e = 0; e < n_edges; ++e) {
        for (std::uint32_t side = 0; side < 2; ++side) {
            const std::uint32_t slot = next_slot(edges(e, side))++;
            head(slot) = edges(e, 1 - side);
            arc(slot) = static_cast<std::uint32_t>(2 * e + side);
        }
    }
}

}  // namespace

PGM_KERNELS(module) {
    module.add("fill_slots", fill_slots, "edges"_a, "next_slot"_a, "start"_a, "head"_a, "arc"_a);
}
