// Arrays that a kernel returns, where only it finds out how long they are.

#pragma once

#include <nanobind/ndarray.h>

#include <array>
#include <vector>

namespace pgm {

// Rows of N numbers, (n, N) for Python; (n,) if N is 1.
template <class T, int N = 1> struct Rows : std::vector<std::array<T, N>> {};

}  // namespace pgm

namespace nanobind::detail {

template <class T, int N> struct type_caster<pgm::Rows<T, N>> {
    using Value = pgm::Rows<T, N>;
    static constexpr auto Name = const_name("array");

    static handle from_cpp(Value &&rows, rv_policy, cleanup_list *) noexcept {
        auto *kept = new Value(std::move(rows));
        kept->reserve(1);  // an empty array has an address too
        const capsule owner(kept, [](void *it) noexcept { delete static_cast<Value *>(it); });
        const std::size_t shape[2] = {kept->size(), N};
        const ndarray<numpy, T> array(kept->data(), N == 1 ? 1 : 2, shape, owner);
        return make_caster<ndarray<numpy, T>>::from_cpp(array, rv_policy::automatic, nullptr);
    }
};

}  // namespace nanobind::detail
