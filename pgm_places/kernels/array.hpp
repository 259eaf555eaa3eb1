// Arrays and named tuples of Python as kernels see them.
//
// A kernel reads an `Array<const float, 2>` and writes an `Array<float, 2>`. Only a C-contiguous array
// of exactly this type and number of dimensions is accepted. Nothing is converted, because results in a
// copy would not reach the caller.

#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <tuple>
#include <cstdint>
#include <cstdlib>
#include <type_traits>
#include <utility>

namespace pgm {

template <class T, int N> class Array {
  public:
    static_assert(N >= 1);

    Array() = default;
    Array(T *data, const std::array<std::int64_t, N> &shape) : data_(data), shape_(shape) {}

    // Of what is written, a view that is only read.
    operator Array<const T, N>() const { return {data_, shape_}; }

    template <class... Index> T &operator()(Index... index) const {
        static_assert(sizeof...(Index) == N);
        return data_[offset({static_cast<std::int64_t>(index)...})];
    }

    // The rows of one index less: array[i] of a matrix is row i.
    decltype(auto) operator[](std::int64_t index) const {
#ifdef PGM_CHECKED
        if (index < 0 || index >= shape_[0]) std::abort();
#endif
        if constexpr (N == 1) {
            return static_cast<T &>(data_[index]);
        } else {
            std::array<std::int64_t, N - 1> rest;
            std::int64_t size = 1;
            for (int d = 1; d < N; ++d) size *= rest[d - 1] = shape_[d];
            return Array<T, N - 1>(data_ + index * size, rest);
        }
    }

    T *data() const { return data_; }
    T *begin() const { return data_; }
    T *end() const { return data_ + size(); }
    std::int64_t shape(int dimension) const { return shape_[dimension]; }
    std::int64_t size() const {
        std::int64_t size = 1;
        for (std::int64_t length : shape_) size *= length;
        return size;
    }

  private:
    std::int64_t offset(const std::array<std::int64_t, N> &index) const {
        std::int64_t at = 0;
        for (int d = 0; d < N; ++d) {
#ifdef PGM_CHECKED
            if (index[d] < 0 || index[d] >= shape_[d]) std::abort();
#endif
            at = at * shape_[d] + index[d];
        }
        return at;
    }

    T *data_ = nullptr;
    std::array<std::int64_t, N> shape_{};
};

// Whether a letter of Python's buffer protocol stands for numbers of this type's kind.
template <class T> bool is_format_of(const char *format) {
    if (format == nullptr || format[0] == '\0' || format[1] != '\0') return false;
    const char *letters = std::is_same_v<T, bool>           ? "?"
                          : std::is_floating_point_v<T>     ? "fd"
                          : std::is_signed_v<T>             ? "bhilqn"
                                                            : "BHILQN";
    for (; *letters != '\0'; ++letters)
        if (*letters == *format) return true;
    return false;
}

// A struct that is taken from a named tuple of Python: it lists its members in the tuple's order.
//
//     struct Arcs {
//         Array<const std::uint32_t, 1> start, head, arc, ends;
//         auto fields() { return std::tie(start, head, arc, ends); }
//     };
template <class Struct>
concept FromTuple = std::is_default_constructible_v<Struct> && requires(Struct whole) {
    std::tuple_size<decltype(whole.fields())>::value;
};

}  // namespace pgm

namespace nanobind::detail {

template <class T> constexpr auto kind_name() {
    using Plain = std::remove_const_t<T>;
    if constexpr (std::is_same_v<Plain, bool>) return const_name("bool");
    else if constexpr (std::is_same_v<Plain, float>) return const_name("float32");
    else if constexpr (std::is_same_v<Plain, double>) return const_name("float64");
    else if constexpr (std::is_signed_v<Plain>)
        return const_name("int") + const_name<8 * sizeof(T)>();
    else return const_name("uint") + const_name<8 * sizeof(T)>();
}

template <class T, int N> struct type_caster<pgm::Array<T, N>> {
    using Value = pgm::Array<T, N>;
    static constexpr bool IsClass = false;
    template <class U> using Cast = Value;
    static constexpr auto Name = const_name("array[") + kind_name<T>() + const_name(", ndim=") +
                                 const_name<N>() + const_name<std::is_const_v<T>>("", ", writable") +
                                 const_name("]");

    type_caster() = default;
    type_caster(const type_caster &) = delete;
    ~type_caster() {
        if (buffer_.obj != nullptr) PyBuffer_Release(&buffer_);
    }

    bool from_python(handle source, std::uint8_t, cleanup_list *) noexcept {
        constexpr int wanted =
            PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (std::is_const_v<T> ? 0 : PyBUF_WRITABLE);
        if (PyObject_GetBuffer(source.ptr(), &buffer_, wanted) != 0) {
            PyErr_Clear();
            buffer_.obj = nullptr;
            return false;
        }
        if (buffer_.ndim != N || buffer_.itemsize != sizeof(T) ||
            !pgm::is_format_of<std::remove_const_t<T>>(buffer_.format))
            return false;
        std::array<std::int64_t, N> shape;
        for (int d = 0; d < N; ++d) shape[d] = buffer_.shape[d];
        value_ = Value(static_cast<T *>(buffer_.buf), shape);
        return true;
    }

    template <class U> bool can_cast() const noexcept { return true; }
    operator Value() { return value_; }

  private:
    Py_buffer buffer_{};
    Value value_;
};

template <pgm::FromTuple Struct> struct type_caster<Struct> {
    using Value = Struct;
    using Fields = decltype(std::declval<Struct &>().fields());
    static constexpr std::size_t N = std::tuple_size_v<Fields>;
    static constexpr bool IsClass = false;
    template <class U> using Cast = Value;
    template <std::size_t... I> static constexpr auto names(std::index_sequence<I...>) {
        return concat(make_caster<std::tuple_element_t<I, Fields>>::Name...);
    }
    static constexpr auto Name =
        const_name("tuple[") + names(std::make_index_sequence<N>()) + const_name("]");

    bool from_python(handle source, std::uint8_t flags, cleanup_list *cleanup) noexcept {
        if (!PyTuple_Check(source.ptr()) || PyTuple_Size(source.ptr()) != Py_ssize_t(N)) return false;
        return parts_from(source, flags, cleanup, std::make_index_sequence<N>());
    }

    template <class U> bool can_cast() const noexcept { return true; }
    operator Value() { return whole(std::make_index_sequence<N>()); }

  private:
    template <std::size_t I> using Member = std::remove_cvref_t<std::tuple_element_t<I, Fields>>;

    template <std::size_t... I>
    bool parts_from(handle source, std::uint8_t flags, cleanup_list *cleanup,
                    std::index_sequence<I...>) noexcept {
        return (std::get<I>(parts_).from_python(PyTuple_GetItem(source.ptr(), I), flags, cleanup) &&
                ...);
    }

    template <std::size_t... I> Value whole(std::index_sequence<I...>) {
        Value value;
        Fields fields = value.fields();
        ((std::get<I>(fields) = std::get<I>(parts_).operator cast_t<Member<I>>()), ...);
        return value;
    }

    template <class> struct CastersOf;
    template <class... Members> struct CastersOf<std::tuple<Members...>> {
        using type = std::tuple<make_caster<std::remove_cvref_t<Members>>...>;
    };
    typename CastersOf<Fields>::type parts_;
};

}  // namespace nanobind::detail
