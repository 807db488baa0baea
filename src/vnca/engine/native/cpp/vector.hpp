// Vectors, and the numbers that products are made of. For the inner loops alone (block.cpp here and
// decode_block.cpp), which are compiled once for each instruction set, with VNCA_TARGET naming it;
// vectors are the compiler's own, as wide as the flags of the target allow.
//
// Everything here is local to the file that includes it, and no function of the standard library is
// called but memcpy, sin and cos: an inline function compiled for AVX-512 must never be the one that
// the linker keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(VNCA_BFLOAT16)
#include <immintrin.h>
#endif

namespace vnca::VNCA_TARGET {
namespace {

#if defined(__AVX512F__)
constexpr int LANES = 16, REGISTERS = 32;
#elif defined(__AVX__)
constexpr int LANES = 8, REGISTERS = 16;
#elif defined(__aarch64__)
constexpr int LANES = 4, REGISTERS = 32;
#else
constexpr int LANES = 4, REGISTERS = 16;
#endif

#define INLINE inline __attribute__((always_inline))

template <class V, class T>
INLINE V load_as(const T* from) {
    V v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

typedef float Vec __attribute__((vector_size(LANES * sizeof(float))));

INLINE Vec load(const float* from) { return load_as<Vec>(from); }
INLINE void store(float* to, Vec v) { std::memcpy(to, &v, sizeof v); }

// Adds the first `count` floats of a vector to what there is.
INLINE void add_first(float* to, Vec v, int count) {
    if (count >= LANES) return store(to, load(to) + v);
    typedef float Four __attribute__((vector_size(4 * sizeof(float))));
    float values[LANES];
    store(values, v);
    int c = 0;
    for (; c + 4 <= count; c += 4) {
        const Four sum = load_as<Four>(to + c) + load_as<Four>(values + c);
        std::memcpy(to + c, &sum, sizeof sum);
    }
    for (; c < count; ++c) to[c] += values[c];
}

constexpr std::size_t round_up(std::size_t x, std::size_t to) { return (x + to - 1) / to * to; }

// Products multiply numbers, float or bfloat16, and sum up floats. DEPTH numbers that follow one
// another along the depth of a product make a unit: one instruction multiplies a vector of them and
// adds up what comes of each. A unit is as wide as a float.
#if defined(VNCA_BFLOAT16)
constexpr int DEPTH = 2;
typedef std::uint16_t Number __attribute__((may_alias));
typedef std::uint32_t Unit __attribute__((may_alias));
typedef std::uint32_t Units __attribute__((vector_size(LANES * sizeof(Unit))));
typedef std::uint16_t Numbers __attribute__((vector_size(LANES * sizeof(Number))));

INLINE Number number(float x) {
    return Number(_mm_extract_epi16((__m128i)_mm_cvtneps_pbh(_mm_set_ss(x)), 0));
}

INLINE void put(Number* to, Vec v) {
    const __m256bh numbers = _mm512_cvtneps_pbh((__m512)v);
    std::memcpy(to, &numbers, sizeof numbers);
}

INLINE Vec get(const Number* from) {
    return (Vec)(__builtin_convertvector(load_as<Numbers>(from), Units) << 16);
}

INLINE Vec multiply_add(Unit a, Units b, Vec sum) {
    return (Vec)_mm512_dpbf16_ps((__m512)sum, (__m512bh)(a + Units{}), (__m512bh)b);
}

// A multiply-add that waits for the one before it, and of which nothing can be done beforehand.
INLINE Vec chained(Vec sum, Units by) {
    return (Vec)_mm512_dpbf16_ps((__m512)sum, (__m512bh)by, (__m512bh)by);
}

// Numbers in rows, `count` of them in use, put into `room` as units across the rows, for products
// along them. A row of units takes DEPTH strides.
INLINE const Unit* interleave(const Unit* rows, std::size_t stride, int count, int width,
                              Unit* room) {
    for (int i = 0; i < count; i += DEPTH)
        for (int j = 0; j < width; j += LANES) {
            const Number* const from = reinterpret_cast<const Number*>(rows + i * stride) + j;
            const Units upper = i + 1 < count ? (Units)get(from + DEPTH * stride) : Units{};
            const Units both = (Units)get(from) >> 16 | upper;
            std::memcpy(room + i * stride + j, &both, sizeof both);
        }
    return room;
}
#else
constexpr int DEPTH = 1;
typedef float Number;
typedef float Unit;
typedef Vec Units;

INLINE Number number(float x) { return x; }
INLINE void put(Number* to, Vec v) { store(to, v); }
INLINE Vec get(const Number* from) { return load(from); }
INLINE Vec multiply_add(Unit a, Units b, Vec sum) { return a * b + sum; }
INLINE Vec chained(Vec sum, Units by) { return sum * by + by; }

// Units of one number are across the rows as they are along them.
INLINE const Unit* interleave(const Unit* rows, std::size_t, int, int, Unit*) { return rows; }
#endif
static_assert(sizeof(Unit) == sizeof(float) && sizeof(Number) * DEPTH == sizeof(Unit));

constexpr std::size_t units(std::size_t numbers) { return (numbers + DEPTH - 1) / DEPTH; }

// The stride of rows in scratch: an odd number of vectors, so that rows start in different sets of
// the cache.
constexpr std::size_t stride_of(std::size_t numbers) {
    return (round_up(units(numbers), LANES) / LANES | 1) * LANES;
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
