// Sets that grow together, as a forest: each member names another of its set, the root itself.

#pragma once

#include "pgm_places/kernels/array.hpp"

namespace pgm {

// The member that stands for the set of `i`; the way there is halved for the next search.
template <class Index> inline Index root(const Array<Index, 1> &parent, Index i) {
    while (parent(i) != i) {
        parent(i) = parent(parent(i));
        i = parent(i);
    }
    return i;
}

}  // namespace pgm
