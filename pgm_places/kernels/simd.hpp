// Vectors of a few numbers, in parts as wide as the processor's registers.
//
// No operation mixes lanes unless its name says so, and sums and fused products are evaluated exactly
// as written, so that a lane's bits depend neither on the other lanes nor on the machine.
//
// A kernel that uses them is a template over BYTES, the width of a register, and is compiled for
// each kind of processor: see `variants`. Everything that it calls has to be PGM_INLINE.

#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <type_traits>
#include <utility>

// Checked kernels, for tests, are compiled for one width only, because compiling is slow.
#if (defined(__x86_64__) || defined(_M_X64)) && !defined(PGM_CHECKED)
#define PGM_VARIANTS
#include <cpuid.h>
#endif

#define PGM_INLINE inline __attribute__((always_inline))
#define PGM_INLINE_LAMBDA __attribute__((always_inline))  // behind a lambda's parameters

namespace pgm {

template <class T, int N> struct Register {
    // Aligned by name: for vectors wider than the machine's registers GCC forgets to.
    typedef T type __attribute__((vector_size(N * sizeof(T)), aligned(N * sizeof(T))));
    // The same anywhere in memory. A copy by memcpy would go through the small registers that every
    // processor has.
    typedef T loose __attribute__((vector_size(N * sizeof(T)), aligned(1), may_alias));
};

// What comparing two numbers of a type gives: all bits are set, or none.
template <class T> using Flag = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;

template <class T, int N, int BYTES> struct alignas(std::min<int>(N * sizeof(T), BYTES)) Simd {
    static constexpr int WIDTH = std::min<int>(N, BYTES / sizeof(T)), PARTS = N / WIDTH;
    using Part = typename Register<T, WIDTH>::type;
    using Mask = Simd<Flag<T>, N, BYTES>;

    Part part[PARTS];

    static PGM_INLINE Simd load(const T *from) {
        return each([&](int p) { return Part(loose(from + p * WIDTH)); });
    }

    static PGM_INLINE Simd splat(T value) {
        return each([&](int) { return Part{} + value; });
    }

    // Lanes made of the function of each part's number.
    template <class Function> static PGM_INLINE Simd each(Function function) {
        Simd lanes;
        for (int p = 0; p < PARTS; ++p) lanes.part[p] = function(p);
        return lanes;
    }

    // Lanes made of the function of each lane's number.
    template <class Function> static PGM_INLINE Simd every(Function function) {
        Simd lanes;
        for (int p = 0; p < PARTS; ++p)
            for (int i = 0; i < WIDTH; ++i) lanes.part[p][i] = function(p * WIDTH + i);
        return lanes;
    }

    PGM_INLINE void store(T *to) const {
        for (int p = 0; p < PARTS; ++p) loose(to + p * WIDTH) = part[p];
    }

    // Flags of what `compare` says of vectors; of half a part at a time where parts have 64 bytes,
    // whose flags GCC would find one by one.
    template <class Compare>
    static PGM_INLINE Mask compared(const Simd &a, const Simd &b, Compare compare) {
        constexpr int LONGEST = std::min<int>(WIDTH, 32 / sizeof(T)), PIECES = WIDTH / LONGEST;
        using Piece = typename Register<T, LONGEST>::loose;
        using Flags = typename Register<Flag<T>, LONGEST>::loose;
        Mask mask;
        for (int p = 0; p < PARTS; ++p) {
            const auto x = reinterpret_cast<const Piece *>(&a.part[p]);
            const auto y = reinterpret_cast<const Piece *>(&b.part[p]);
            const auto flags = reinterpret_cast<Flags *>(&mask.part[p]);
            for (int i = 0; i < PIECES; ++i) flags[i] = compare(x[i], y[i]);
        }
        return mask;
    }

    // A part's worth of numbers in memory.
    static PGM_INLINE auto &loose(T *at) {
        return *reinterpret_cast<typename Register<T, WIDTH>::loose *>(at);
    }
    static PGM_INLINE const auto &loose(const T *at) {
        return *reinterpret_cast<const typename Register<T, WIDTH>::loose *>(at);
    }

    PGM_INLINE T operator[](int lane) const { return part[lane / WIDTH][lane % WIDTH]; }

    friend PGM_INLINE Simd operator+(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] + b.part[p]; });
    }
    friend PGM_INLINE Simd operator-(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] - b.part[p]; });
    }
    friend PGM_INLINE Simd operator*(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] * b.part[p]; });
    }
    friend PGM_INLINE Simd operator/(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] / b.part[p]; });
    }
    // With a number, the same in every lane.
    friend PGM_INLINE Simd operator+(Simd a, T b) { return a + splat(b); }
    friend PGM_INLINE Simd operator-(Simd a, T b) { return a - splat(b); }
    friend PGM_INLINE Simd operator*(Simd a, T b) { return a * splat(b); }
    friend PGM_INLINE Simd operator*(T a, Simd b) { return splat(a) * b; }
    friend PGM_INLINE Simd operator/(Simd a, T b) { return a / splat(b); }
    friend PGM_INLINE Mask operator>(Simd a, T b) { return a > splat(b); }
    friend PGM_INLINE Mask operator<(Simd a, T b) { return a < splat(b); }
    friend PGM_INLINE Mask operator>=(Simd a, T b) { return a >= splat(b); }
    friend PGM_INLINE Mask operator<=(Simd a, T b) { return a <= splat(b); }
    friend PGM_INLINE Mask operator==(Simd a, T b) { return a == splat(b); }
    friend PGM_INLINE Mask operator>(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x > y; });
    }
    friend PGM_INLINE Mask operator<(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x < y; });
    }
    friend PGM_INLINE Mask operator>=(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x >= y; });
    }
    friend PGM_INLINE Mask operator<=(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x <= y; });
    }
    friend PGM_INLINE Mask operator==(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x == y; });
    }
    friend PGM_INLINE Mask operator!=(Simd a, Simd b) {
        return compared(a, b, [](auto x, auto y) PGM_INLINE_LAMBDA { return x != y; });
    }
    friend PGM_INLINE Simd operator&(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] & b.part[p]; });
    }
    friend PGM_INLINE Simd operator|(Simd a, Simd b) {
        return each([&](int p) { return a.part[p] | b.part[p]; });
    }
};

// `a` where the mask holds, `b` elsewhere.
template <class T, int N, int B>
PGM_INLINE Simd<T, N, B> select(Simd<Flag<T>, N, B> mask, Simd<T, N, B> a, Simd<T, N, B> b) {
    return a.each([&](int p) { return mask.part[p] ? a.part[p] : b.part[p]; });
}

// The larger of two numbers; the second where one is NaN.
template <class T, int N, int B>
PGM_INLINE Simd<T, N, B> largest(Simd<T, N, B> a, Simd<T, N, B> b) {
    return a.each([&](int p) { return a.part[p] > b.part[p] ? a.part[p] : b.part[p]; });
}

// The smaller of two numbers; the second where one is NaN.
template <class T, int N, int B>
PGM_INLINE Simd<T, N, B> smallest(Simd<T, N, B> a, Simd<T, N, B> b) {
    return a.each([&](int p) { return a.part[p] < b.part[p] ? a.part[p] : b.part[p]; });
}

// `a * b + c` rounded once.
template <class T, int N, int B>
PGM_INLINE Simd<T, N, B> fma(Simd<T, N, B> a, Simd<T, N, B> b, Simd<T, N, B> c) {
    return a.each([&](int p) PGM_INLINE_LAMBDA {
#if defined(__clang__)
        return __builtin_elementwise_fma(a.part[p], b.part[p], c.part[p]);
#else
        // A loop over memory, which GCC makes one instruction also within long functions.
        constexpr int WIDTH = Simd<T, N, B>::WIDTH;
        T x[WIDTH], y[WIDTH], z[WIDTH];
        a.loose(x) = a.part[p];
        a.loose(y) = b.part[p];
        a.loose(z) = c.part[p];
#pragma GCC unroll 1
        for (int i = 0; i < WIDTH; ++i) z[i] = std::fma(x[i], y[i], z[i]);
        const typename Simd<T, N, B>::Part sum = a.loose(z);
        return sum;
#endif
    });
}

template <class T, int N, int B> PGM_INLINE Simd<T, N, B> square_root(Simd<T, N, B> a) {
    return a.every([&](int lane) { return std::sqrt(a[lane]); });
}

template <class T, int N, int B> PGM_INLINE Simd<T, N, B> absolute(Simd<T, N, B> a) {
    return a.every([&](int lane) { return std::fabs(a[lane]); });
}

// Every lane rounded to the nearest integer, halves to the even one.
template <class T, int N, int B> PGM_INLINE Simd<T, N, B> nearest_integer(Simd<T, N, B> a) {
    return a.every([&](int lane) { return std::nearbyint(a[lane]); });
}

// 2 to the power of every lane: whole numbers from -1022 to 1023.
template <int N, int B> PGM_INLINE Simd<double, N, B> power_of_two(Simd<double, N, B> a) {
    using L = Simd<double, N, B>;
    using Whole = typename Register<std::int64_t, L::WIDTH>::type;
    return L::each([&](int p) {
        const auto moved = a.part[p] + (0x1.8p52 + 1023);  // the exponent is in the lowest bits
        return (typename L::Part)((Whole)moved << 52);     // the same bits, as another type
    });
}

// Whether a bit is set in some bytes, halves of which are combined until eight are left.
template <int BYTES, class Part> PGM_INLINE bool any_bit(Part bits) {
    if constexpr (BYTES == 8) {
        std::uint64_t word;
        std::memcpy(&word, &bits, sizeof(word));
        return word != 0;
    } else {
        using Half = typename Register<std::uint64_t, BYTES / 16>::loose;
        const auto halves = reinterpret_cast<const Half *>(&bits);
        return any_bit<BYTES / 2>(halves[0] | halves[1]);
    }
}

template <class T, int N, int B> PGM_INLINE bool any_lane(Simd<T, N, B> mask) {
    auto any = mask.part[0];
    for (int p = 1; p < mask.PARTS; ++p) any |= mask.part[p];
    return any_bit<sizeof(any)>(any);
}

template <int N, int B> PGM_INLINE Simd<float, N, B> narrow(Simd<double, N, B> a) {
    return Simd<float, N, B>::every([&](int lane) { return static_cast<float>(a[lane]); });
}

template <int N, int B> PGM_INLINE Simd<double, N, B> widen(Simd<float, N, B> a) {
    using Wide = Simd<double, N, B>;
    using Few = typename Register<float, Wide::WIDTH>::loose;
    return Wide::each([&](int p) PGM_INLINE_LAMBDA {
        const Few few = reinterpret_cast<const Few *>(&a)[p];
        return __builtin_convertvector(few, typename Wide::Part);
    });
}

// The sum of all lanes: of the two halves' sums, added lane by lane until one is left.
template <class T, int N, int B> PGM_INLINE T sum_of_lanes(Simd<T, N, B> lanes) {
    T sums[N];
    lanes.store(sums);
    for (int half = N / 2; half > 0; half /= 2)
        for (int lane = 0; lane < half; ++lane) sums[lane] = sums[lane] + sums[lane + half];
    return sums[0];
}

// The sum of all lanes from the first to the last.
template <class T, int N, int B> PGM_INLINE T sum_in_order(Simd<T, N, B> lanes) {
    T sum = lanes[0];
    for (int lane = 1; lane < N; ++lane) sum = sum + lanes[lane];
    return sum;
}

// The largest of all lanes, none of which is NaN.
template <class T, int N, int B> PGM_INLINE T highest_lane(Simd<T, N, B> lanes) {
    T highest = lanes[0];
    for (int lane = 1; lane < N; ++lane) highest = lanes[lane] > highest ? lanes[lane] : highest;
    return highest;
}

// The lanes of two parts in turn, from `FIRST` of each on.
template <int FIRST, class Part, int... I>
PGM_INLINE Part interleaved(Part a, Part b, std::integer_sequence<int, I...>) {
    constexpr int N = sizeof...(I);
#if defined(__clang__)
    return __builtin_shufflevector(a, b, (FIRST + I / 2 + I % 2 * N)...);
#else
    using Places = typename Register<Flag<std::remove_cvref_t<decltype(a[0])>>, N>::type;
    return __builtin_shuffle(a, b, Places{(FIRST + I / 2 + I % 2 * N)...});
#endif
}

// Turn over a square of numbers: vectors of one part, as many as each has lanes.
template <class T, int N, int B> PGM_INLINE void transpose(Simd<T, N, B> (&rows)[N]) {
    static_assert(Simd<T, N, B>::PARTS == 1);
    constexpr auto lanes = std::make_integer_sequence<int, N>();
    for (int round = 1; round < N; round *= 2) {
        Simd<T, N, B> next[N];
        for (int k = 0; k < N / 2; ++k) {
            const auto a = rows[k].part[0], b = rows[k + N / 2].part[0];
            next[2 * k].part[0] = interleaved<0>(a, b, lanes);
            next[2 * k + 1].part[0] = interleaved<N / 2>(a, b, lanes);
        }
        std::copy_n(next, N, rows);
    }
}

// `(code >> shift) & mask` of as many bytes as there are lanes.
template <class L> PGM_INLINE L field_at(const std::uint8_t *codes, int shift, int mask) {
    return L::every([&](int lane) { return static_cast<float>((codes[lane] >> shift) & mask); });
}

// What tests take away from the processor: kernels use no wider registers than this.
inline int &register_limit() {
    static int bytes = 64;
    return bytes;
}

#ifdef PGM_VARIANTS
// Queries the processor itself, because not every compiler's library supports the query.
inline int widest_registers() {
    static const int bytes = [] {
        unsigned a, b, c, d, wide, unused;
        const auto all = [](unsigned bits, std::initializer_list<int> wanted) {
            return std::all_of(wanted.begin(), wanted.end(),
                               [bits](int bit) { return (bits >> bit & 1) != 0; });
        };
        // FMA, MOVBE, XGETBV, AVX, F16C
        if (!__get_cpuid(1, &a, &b, &c, &d) || !all(c, {12, 22, 27, 28, 29})) return 16;
        if (!__get_cpuid_count(7, 0, &a, &wide, &c, &d) || !all(wide, {3, 5, 8})) return 16;
        if (!__get_cpuid(0x80000001, &a, &b, &c, &d) || !all(c, {5})) return 16;  // LZCNT
        unsigned kept;  // which registers the system keeps for each process
        __asm__("xgetbv" : "=a"(kept), "=d"(unused) : "c"(0));
        if (!all(kept, {1, 2})) return 16;
        // AVX-512 F, DQ, CD, BW, VL
        return all(wide, {16, 17, 28, 30, 31}) && all(kept, {5, 6, 7}) ? 64 : 32;
    }();
    return bytes;
}
#else
inline int widest_registers() { return 16; }
#endif

// The width in bytes of the registers that kernels use.
inline int register_bytes() { return std::min(widest_registers(), register_limit()); }

template <class Kernel, class Signature> struct Variants;

template <class Kernel, class Result, class... Arguments>
struct Variants<Kernel, Result (*)(Arguments...)> {
#ifdef PGM_VARIANTS
    __attribute__((target("arch=x86-64-v4"), flatten)) static Result v4(Arguments... arguments) {
        return Kernel::template run<64>(arguments...);
    }
    __attribute__((target("arch=x86-64-v3"), flatten)) static Result v3(Arguments... arguments) {
        return Kernel::template run<32>(arguments...);
    }
#endif
    __attribute__((flatten)) static Result v1(Arguments... arguments) {
        return Kernel::template run<16>(arguments...);
    }
    static Result run(Arguments... arguments) {
#ifdef PGM_VARIANTS
        const int bytes = register_bytes();
        if (bytes == 64) return v4(arguments...);
        if (bytes == 32) return v3(arguments...);
#endif
        return v1(arguments...);
    }
};

// The function that calls `Kernel::run<BYTES>` compiled for this processor, to add to a module:
//
//     struct UpdateParts {
//         template <int BYTES> static PGM_INLINE void run(Array<float, 2> beliefs, ...) { ... }
//     };
template <class Kernel>
constexpr auto variants = &Variants<Kernel, decltype(&Kernel::template run<16>)>::run;

}  // namespace pgm
