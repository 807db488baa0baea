// Values continued into cells that have none, in bricks of 8³.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "ranges.hpp"
#include "thread_pool.hpp"

namespace vnca {

// Cells of bricks laid out flat, three values each, and one brick more that stands for nothing.
struct Filling {
    static constexpr int EDGE = 8, BRICK = EDGE * EDGE * EDGE, WAYS = 6;
    std::int64_t bricks;
    float* values;               // [bricks + 1, BRICK, 3]
    const std::uint8_t* known;   // [bricks + 1, BRICK]
    const std::int64_t* beside;  // [WAYS, bricks] first cells of the next bricks, down and up an axis

    // Where the next cell lies; -1 if that is out of range.
    std::int64_t next(std::int64_t cell, int way) const {
        const std::int64_t brick = cell / BRICK, place = cell % BRICK;
        const int stride = way < 2 ? EDGE * EDGE : way < 4 ? EDGE : 1, at = int(place / stride) % EDGE;
        const bool up = way % 2 != 0;
        if (at != (up ? EDGE - 1 : 0)) return cell + (up ? stride : -stride);
        const std::int64_t first = beside[way * bricks + brick];
        if (first < 0 || first > bricks * BRICK) return -1;
        return first + place + (up ? 1 - EDGE : EDGE - 1) * stride;
    }

    // The mean of the known ones of its six neighbours; false if something is out of range.
    bool fill(std::int64_t cell) const {
        if (cell < 0 || cell >= bricks * BRICK || known[cell]) return false;
        double total[3] = {}, count = 0;  // the sum of up to six equal floats is exact
        for (int way = 0; way < WAYS; ++way) {
            const std::int64_t there = next(cell, way);
            if (there < 0) return false;
            if (!known[there]) continue;
            for (int axis = 0; axis < 3; ++axis) total[axis] += values[3 * there + axis];
            ++count;
        }
        for (int axis = 0; axis < 3; ++axis) values[3 * cell + axis] = float(total[axis] / count);
        return true;
    }
};

// Fills cells [count], each once, none of them known: none is read for another.
inline bool fill(const Filling& filling, const std::int64_t* cells, std::int64_t count, int threads) {
    const Ranges ranges(count);
    std::atomic<bool> valid = true;
    ThreadPool::of_process().run(ranges.count, std::max(1, threads), [&](int range, int) {
        for (std::int64_t i = ranges.begin(range); i < ranges.end(range); ++i)
            if (!filling.fill(cells[i])) valid = false;
    });
    return valid;
}

}  // namespace vnca
