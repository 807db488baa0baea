// What moves while a shutter is open, averaged along its way. As src/vnca/rendering/shutter.py has it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "march.hpp"

namespace vnca {

constexpr std::int64_t CHANNELS = 4;  // of a picture

// To `result` [rows, columns, 4] the means of `picture` at `count` places on the way through each pixel;
// `way` [rows, columns, 2] is down and to the right. Pixels with a way shorter than `still` stay.
inline void smear(const float* picture, const float* way, std::int64_t rows, std::int64_t columns,
                  std::int64_t count, float still, float* result, int threads) {
    const float last[2] = {float(rows - 1), float(columns - 1)};
    const Ranges ranges(rows, 1);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        for (std::int64_t row = ranges.begin(range); row < ranges.end(range); ++row)
            for (std::int64_t column = 0; column < columns; ++column) {
                const std::int64_t pixel = row * columns + column;
                const float down = way[2 * pixel], right = way[2 * pixel + 1];
                float* const to = result + CHANNELS * pixel;
                if (!(down * down + right * right >= still * still)) {
                    std::copy_n(picture + CHANNELS * pixel, CHANNELS, to);
                    continue;
                }
                float sum[CHANNELS] = {};
                for (std::int64_t k = 0; k < count; ++k) {
                    const float time = (float(k) + 0.5f) / float(count) - 0.5f;
                    const float y = std::clamp(float(row) + time * down, 0.0f, last[0]);
                    const float x = std::clamp(float(column) + time * right, 0.0f, last[1]);
                    const std::int64_t top = below(y), left = below(x);
                    const std::int64_t bottom = std::min(top + 1, rows - 1);
                    const std::int64_t beside = std::min(left + 1, columns - 1);
                    const float v = y - float(top), u = x - float(left);
                    const float* const a = picture + CHANNELS * (top * columns + left);
                    const float* const b = picture + CHANNELS * (top * columns + beside);
                    const float* const c = picture + CHANNELS * (bottom * columns + left);
                    const float* const d = picture + CHANNELS * (bottom * columns + beside);
                    for (std::int64_t i = 0; i < CHANNELS; ++i)
                        sum[i] += (a[i] * (1 - u) + b[i] * u) * (1 - v) + (c[i] * (1 - u) + d[i] * u) * v;
                }
                for (std::int64_t i = 0; i < CHANNELS; ++i) to[i] = sum[i] / float(count);
            }
    });
}

}  // namespace vnca
