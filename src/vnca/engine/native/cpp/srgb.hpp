// From sRGB to linear light, whole vectors. For decode_block.cpp alone, like vector.hpp.
// Reference: IEC 61966-2-1:1999; core/colour.py has it in numpy.
#pragma once

#include "sine.hpp"

namespace vnca::VNCA_TARGET {
namespace {

INLINE Vec chosen(Ints which, Vec yes, Vec no) {
    return (Vec)((which & (Ints)yes) | (~which & (Ints)no));
}

// What is no number stays so.
INLINE Vec limited(Vec v, float least, float most) {
    v = chosen(v < least, Vec{} + least, v);
    return chosen(v > most, Vec{} + most, v);
}

// Of numbers in [0, 1]; off by 4e-7 of the result at most. The power 2.4 of u in [0.09, 1] is that
// of u 2ⁿ in [½, 1], a minimax polynomial, times 2^(−2.4 n).
INLINE Vec linear_light(Vec v) {
    constexpr float SMALLER = 0.189464571f;  // 2^−2.4
    Vec u = (v + 0.055f) * (1 / 1.055f);
    Vec scale = Vec{} + 1.0f;
    for (int halving = 0; halving < 4; ++halving) {
        const Ints small = u < 0.5f;
        u = chosen(small, u + u, u);
        scale = chosen(small, scale * SMALLER, scale);
    }
    Vec power = u * -0.0152488342f + 0.0923155248f;
    power = power * u - 0.270613492f;
    power = power * u + 0.687401175f;
    power = power * u + 0.546967208f;
    power = power * u - 0.0437719859f;
    power = power * u + 0.00295035774f;
    return chosen(v <= 0.04045f, v * (1 / 12.92f), power * scale);
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
