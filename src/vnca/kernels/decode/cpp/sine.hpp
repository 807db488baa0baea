// Sines and cosines of whole vectors. For decode_block.cpp alone, like vector.hpp.
#pragma once

#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(LANES * sizeof(std::int32_t))));

// π in three parts. The first two have 8 and 9 bits, so that whole multiples of them are exact up to
// FURTHEST / π, with and without fused multiply-add.
constexpr float PI_1 = 3.140625f, PI_2 = 9.670257568359375e-4f, PI_3 = 6.278329573e-7f;
constexpr float FURTHEST = 1e5f;

// The sine and, if asked for, the cosine of numbers up to FURTHEST: x = qπ + r with |r| ≤ π/2, then
// minimax polynomials, then the sign (−1)^q.
template <bool Cosine>
INLINE void sine(Vec& x, Vec& cosine) {
    constexpr float ROUND = 12582912.0f;  // 1.5 · 2²³: what is added to it becomes whole
    const Vec shifted = x * 0.318309886f + ROUND;
    const Vec q = shifted - ROUND;
    const Vec r = ((x - q * PI_1) - q * PI_2) - q * PI_3;
    const Vec r2 = r * r;
    const Ints sign = (Ints)shifted << 31;
    const Vec odd = r2 * (r2 * (r2 * (r2 * 2.6000246e-6f - 1.98066016e-4f) + 8.3330171e-3f) -
                          0.166666567f);
    x = (Vec)((Ints)(r + r * odd) ^ sign);
    if constexpr (Cosine) {
        const Vec even = r2 * (r2 * (r2 * (r2 * -2.61935497e-7f + 2.47692915e-5f) - 1.38885691e-3f) +
                               4.16666567e-2f) - 0.5f;
        cosine = (Vec)((Ints)(1.0f + r2 * even) ^ sign);
    }
}

// Replaces a row of numbers, whole vectors, by their sines; `cosines` gets their cosines unless it
// is null. What lies too far out, and what is no number, is left to the library.
template <bool Cosine>
INLINE void sines(float* x, float* cosines, std::size_t count) {
    Ints far = {};
    for (std::size_t j = 0; j < count; j += LANES) {
        const Vec v = load(x + j);
        far |= ~((v <= FURTHEST) & (v >= -FURTHEST));
    }
    std::int64_t lanes[LANES / 2], any = 0;
    std::memcpy(lanes, &far, sizeof far);
    for (const std::int64_t two : lanes) any |= two;
    if (__builtin_expect(any != 0, false)) {
        for (std::size_t j = 0; j < count; ++j) {
            const double exact = x[j];
            x[j] = float(__builtin_sin(exact));
            if constexpr (Cosine) cosines[j] = float(__builtin_cos(exact));
        }
        return;
    }
    for (std::size_t j = 0; j < count; j += LANES) {
        Vec v = load(x + j), cosine;
        sine<Cosine>(v, cosine);
        store(x + j, v);
        if constexpr (Cosine) store(cosines + j, cosine);
    }
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
