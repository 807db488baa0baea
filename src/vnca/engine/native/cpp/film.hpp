// A picture of painted smoke in a light: its samples are lit and added up as they are met, with no table of
// them in between. As src/vnca/rendering/view.py has it; the README beside that derives the sums.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "march.hpp"

namespace vnca {

// What colours are multiplied by: `full`, but for a shadow, [shape], z fastest.
struct Light {
    const float* shadow;
    std::int64_t shape[3];
    float first[3], times[3];  // a point of the density is (point + first) / times here
    float full;

    float at(const float point[3]) const {
        float place[3];
        std::int64_t cell[3];
        for (int axis = 0; axis < 3; ++axis) {
            place[axis] = (point[axis] + first[axis]) / times[axis];
            // Outside there is no shadow; and a cell has a number.
            if (!(place[axis] > -1 && place[axis] < float(shape[axis]))) return full;
            cell[axis] = below(place[axis]);
        }
        const Corners corners(shape, cell, place);
        float taken = 0;
        for (int k = 0; k < 8; ++k) taken += corners.weight[k] * shadow[corners.cell[k]];
        return full - taken;
    }
};

// To `pixels` [rays, 3], premultiplied linear RGB, and what passes [rays]. `colour` [shape, 3], linear RGB, is
// interpolated weighted by density. Without a light smoke glows in it.
inline void film(const Density& density, const float* colour, const Light* light, const Rays& rays,
                 float* pixels, float* passes, int threads) {
    const Ranges ranges(rays.count, RAYS_AT_ONCE);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        const Marching marching(density, rays);
        for (std::int64_t ray = ranges.begin(range); ray < ranges.end(range); ++ray) {
            float through = 1, sum[3] = {};
            marching.along(ray, [&](const float point[3], const Corners& corners, float here, float) {
                const float thickness = rays.extinction * here, lit = light ? light->at(point) : 1;
                const float taken = -std::expm1(-thickness);
                const float share = through * taken * lit / std::max(here, THINNEST);
                float hue[3] = {};
                for (int k = 0; k < 8; ++k) {
                    const float by = corners.weight[k] * density.values[corners.cell[k]];
                    for (int c = 0; c < 3; ++c) hue[c] += by * colour[3 * corners.cell[k] + c];
                }
                for (int c = 0; c < 3; ++c) sum[c] += share * hue[c];
                through *= 1 - taken;
            });
            std::copy_n(sum, 3, pixels + 3 * ray);
            passes[ray] = through;
        }
    });
}

}  // namespace vnca
