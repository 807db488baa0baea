// Where smoke has come from: a midpoint step back along its velocity.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "places.hpp"
#include "ranges.hpp"
#include "thread_pool.hpp"

namespace vnca {

// The velocity of cells in bricks of 8³, cells per frame; it is known where it is not zero. Each
// operation is that of `carried_to` in io/velocity.py, in its order: the bits are the same.
struct Tracing {
    PlacesOfBricks places;
    const float* values;  // [bricks, CELLS, 3]
    std::int32_t lower[3], upper[3];  // of the box, in which there are cells
    float least;  // share of what is around that must be known

    // By how much what is at a cell has come to it in some time.
    void trace(const std::int32_t cell[3], float time, float moved[3]) const {
        Nearest near;
        const float* const here = at(cell, near);
        for (int axis = 0; axis < 3; ++axis) moved[axis] = time * (here ? here[axis] : 0.0f);
        double place[3];
        for (int axis = 0; axis < 3; ++axis)
            place[axis] = double(cell[axis]) - double(0.5f * moved[axis]);
        float halfway[3];
        if (interpolate(place, near, halfway))
            for (int axis = 0; axis < 3; ++axis) moved[axis] = time * halfway[axis];
    }

private:
    // The brick that was found last: most of the cells around a place lie in one.
    struct Nearest {
        std::int32_t at[3];
        std::int64_t number = -2;
    };

    const float* at(const std::int32_t cell[3], Nearest& near) const {
        const std::int32_t brick[3] = {cell[0] >> 3, cell[1] >> 3, cell[2] >> 3};
        if (near.number == -2 || !std::equal(brick, brick + 3, near.at)) {
            std::copy_n(brick, 3, near.at);
            near.number = places.find(brick);
        }
        if (near.number < 0) return nullptr;
        return values + 3 * (near.number * PlacesOfBricks::CELLS + PlacesOfBricks::place(cell));
    }

    // The mean of the known ones of the eight cells around a place, by their shares; false if there
    // are none.
    bool interpolate(const double place[3], Nearest& near, float mean[3]) const {
        std::int32_t below[3], next[3];
        float share[2][3];
        for (int axis = 0; axis < 3; ++axis) {
            const std::int32_t first = lower[axis], last = upper[axis] - 1;
            const double inside = std::min(std::max(double(first), place[axis]), double(last));
            below[axis] = std::min(std::int32_t(std::floor(inside)), std::max(last - 1, first));
            next[axis] = last > first;
            share[1][axis] = float(inside - below[axis]);
            share[0][axis] = 1.0f - share[1][axis];
        }
        float total[3] = {}, weight = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const int step[3] = {corner >> 2, corner >> 1 & 1, corner & 1};
            std::int32_t cell[3];
            for (int axis = 0; axis < 3; ++axis) cell[axis] = below[axis] + step[axis] * next[axis];
            const float* const found = at(cell, near);
            if (!found || (found[0] == 0 && found[1] == 0 && found[2] == 0)) continue;
            const float by = share[step[0]][0] * share[step[1]][1] * share[step[2]][2];
            for (int axis = 0; axis < 3; ++axis) total[axis] += by * found[axis];
            weight += by;
        }
        if (!(weight > least)) return false;
        for (int axis = 0; axis < 3; ++axis) mean[axis] = total[axis] / weight;
        return true;
    }
};

// The same of cells [count, 3], in one time for all or one for each, `apart` 0 or 1 from the next:
// `moved` [count, 3].
inline void trace(const Tracing& tracing, const std::int32_t* cells, const float* times,
                  std::int64_t apart, std::int64_t count, float* moved, int threads) {
    const Ranges ranges(count);
    ThreadPool::of_process().run(ranges.count, std::max(1, threads), [&](int range, int) {
        for (std::int64_t i = ranges.begin(range); i < ranges.end(range); ++i)
            tracing.trace(cells + 3 * i, times[i * apart], moved + 3 * i);
    });
}

}  // namespace vnca
