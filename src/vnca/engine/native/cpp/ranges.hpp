// How work is divided among threads, so that results do not depend on how many there are.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

namespace vnca {

// Items are divided among at most TASKS ranges, a division that does not depend on the number of
// threads: sums are then made in the same order whoever makes them.
constexpr std::int64_t TASKS = 64, SMALLEST = 1024;

struct Ranges {
    std::int64_t items, length;
    int count;

    explicit Ranges(std::int64_t n, std::int64_t smallest = SMALLEST)
        : items(n),
          length(std::max(smallest, (n + TASKS - 1) / TASKS)),
          count(int((n + length - 1) / length)) {}

    std::int64_t begin(int range) const { return range * length; }
    std::int64_t end(int range) const { return std::min(items, (range + 1) * length); }
};

// What the work on one range adds to rows that other ranges own, in the order of their owners.
struct Spill {
    std::vector<std::int32_t> rows;
    std::vector<float> values;         // [rows, channels]
    std::vector<std::int64_t> bounds;  // rows of range t are those from bounds[t] to bounds[t + 1]

    // Of the sums [rows, stride] that were made for `met`.
    static Spill of(const std::vector<std::int32_t>& met, const float* sums, std::size_t stride,
                    int channels, const Ranges& owners) {
        Spill spill;
        spill.bounds.assign(owners.count + 1, 0);
        for (const std::int32_t row : met) ++spill.bounds[row / owners.length + 1];
        for (int t = 0; t < owners.count; ++t) spill.bounds[t + 1] += spill.bounds[t];
        spill.rows.resize(met.size());
        spill.values.resize(met.size() * channels);
        std::vector<std::int64_t> next(spill.bounds.begin(), spill.bounds.end() - 1);
        for (const std::int32_t row : met) {
            const std::int64_t at = next[row / owners.length]++;
            spill.rows[at] = row;
            std::memcpy(&spill.values[at * channels], sums, channels * sizeof(float));
            sums += stride;
        }
        return spill;
    }

    // Adds what belongs to one of the owners to `to` [rows, channels].
    void add_to(float* to, int channels, int owner) const {
        for (std::int64_t i = bounds[owner]; i < bounds[owner + 1]; ++i)
            for (int c = 0; c < channels; ++c)
                to[std::int64_t(rows[i]) * channels + c] += values[i * channels + c];
    }
};

}  // namespace vnca
