// Smoke along the rays of a camera: where samples of it can be seen, and the light that they add up to.
// As src/vnca/rendering/march.py has it, which says why; the README beside that derives the sums.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "ranges.hpp"
#include "thread_pool.hpp"

namespace vnca {

constexpr std::int64_t RAYS_AT_ONCE = 256;  // fewest that a thread takes
constexpr float MOST_SAMPLES = 1 << 24;     // on a ray: beyond, floats are no counters

// The whole number below a value that fits into one; std::floor is a call where the processor is any.
inline std::int64_t below(float value) {
    const auto whole = std::int64_t(value);
    return whole - (float(whole) > value);
}

// The eight cells around a point, and their weights in trilinear interpolation: none outside of a field.
struct Corners {
    std::int64_t cell[8];
    float weight[8];

    // `first` is the cell below the point; z is fastest in a field of `shape`.
    Corners(const std::int64_t shape[3], const std::int64_t first[3], const float point[3]) {
        std::int64_t at[3][2];
        float share[3][2];
        for (int axis = 0; axis < 3; ++axis) {
            const std::int64_t here = first[axis], next = here + 1, size = shape[axis];
            const float above = point[axis] - float(here);
            const bool is_in = std::uint64_t(here) < std::uint64_t(size);
            const bool is_next_in = std::uint64_t(next) < std::uint64_t(size);
            at[axis][0] = is_in ? here : 0;
            at[axis][1] = is_next_in ? next : 0;
            share[axis][0] = is_in ? 1 - above : 0;
            share[axis][1] = is_next_in ? above : 0;
        }
        for (int k = 0; k < 8; ++k) {
            const int x = k >> 2, y = k >> 1 & 1, z = k & 1;
            cell[k] = (at[0][x] * shape[1] + at[1][y]) * shape[2] + at[2][z];
            weight[k] = share[0][x] * share[1][y] * share[2][z];
        }
    }
};

// Density [shape], z fastest, and where interpolation meets any: [shape + 1], whose entry [i, j, k]
// stands for the points from (i − 1, j − 1, k − 1) to (i, j, k).
struct Density {
    const float* values;
    std::int64_t shape[3];
    const std::uint8_t* near_smoke;

    bool near(const std::int64_t first[3]) const {
        std::int64_t at = 0;
        for (int axis = 0; axis < 3; ++axis)
            at = at * (shape[axis] + 1) +
                 std::clamp<std::int64_t>(first[axis] + 1, 0, shape[axis]);
        return near_smoke[at] != 0;
    }

    float at(const Corners& corners) const {
        float sum = 0;
        for (int k = 0; k < 8; ++k) sum += corners.weight[k] * values[corners.cell[k]];
        return sum;
    }
};

// Fills in `near` [shape + 1]; returns the least and the greatest cell with smoke, axis by axis, least
// above greatest if there is none.
struct Bounds {
    std::int64_t least[3], most[3];
};

inline Bounds find_smoke(const float* density, const std::int64_t shape[3], std::uint8_t* near,
                         int threads) {
    const std::int64_t planes = shape[0] + 1, rows = shape[1] + 1, columns = shape[2] + 1;
    const Ranges ranges(planes, 1);
    std::vector<Bounds> found(ranges.count);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        Bounds& bounds = found[range];
        for (int axis = 0; axis < 3; ++axis) bounds.least[axis] = shape[axis], bounds.most[axis] = -1;
        for (std::int64_t i = ranges.begin(range); i < ranges.end(range); ++i) {
            std::uint8_t* const plane = near + i * rows * columns;
            std::memset(plane, 0, std::size_t(rows * columns));
            // The planes of cells on both sides of it.
            for (std::int64_t x = std::max<std::int64_t>(i - 1, 0); x <= i && x < shape[0]; ++x)
                for (std::int64_t y = 0; y < shape[1]; ++y) {
                    const float* const cells = density + (x * shape[1] + y) * shape[2];
                    for (std::int64_t z = 0; z < shape[2]; ++z) {
                        if (!(cells[z] > 0)) continue;
                        std::uint8_t* const to = plane + y * columns + z;
                        to[0] = to[1] = to[columns] = to[columns + 1] = 1;
                        if (x != i) continue;
                        const std::int64_t cell[3] = {x, y, z};
                        for (int axis = 0; axis < 3; ++axis) {
                            bounds.least[axis] = std::min(bounds.least[axis], cell[axis]);
                            bounds.most[axis] = std::max(bounds.most[axis], cell[axis]);
                        }
                    }
                }
        }
    });
    Bounds all = found[0];
    for (const Bounds& bounds : found)
        for (int axis = 0; axis < 3; ++axis) {
            all.least[axis] = std::min(all.least[axis], bounds.least[axis]);
            all.most[axis] = std::max(all.most[axis], bounds.most[axis]);
        }
    return all;
}

// Where rays are sampled: at depths (k + offset) · step from `nearest` on, inside of a box.
struct Rays {
    const float *origins, *directions;  // [count, 3], cells
    const float* offsets;               // [1], of all, or [count]
    std::int64_t count, offsets_apart;
    float lower[3], upper[3];           // of the box
    float nearest, step;
    float extinction;  // of density one, in a step: the least that it can be
    float most;        // optical depth behind which nothing is seen
};

struct Sampled {
    std::vector<std::int64_t> starts;  // of each ray and the end of the last
    std::vector<float> points, depth, density;
};

class Marching {
public:
    Marching(const Density& density, const Rays& rays) : density_(density), rays_(rays) {}

    // Calls take(point, corners, density, depth) at the samples of a ray that can be seen, near to far.
    template <class Take>
    void along(std::int64_t ray, Take&& take) const {
        const float* const origin = rays_.origins + 3 * ray;
        const float* const direction = rays_.directions + 3 * ray;
        const float offset = rays_.offsets[rays_.offsets_apart * ray], step = rays_.step;
        float enter = rays_.nearest, leave = INFINITY;
        for (int axis = 0; axis < 3; ++axis) {
            const float a = (rays_.lower[axis] - origin[axis]) / direction[axis];
            const float b = (rays_.upper[axis] - origin[axis]) / direction[axis];
            if (std::isnan(a) || std::isnan(b)) return;  // along a face, where smoke has faded
            enter = std::max(enter, std::min(a, b));
            leave = std::min(leave, std::max(a, b));
        }
        const float first = std::ceil(enter / step - offset);
        const float count = std::floor(leave / step - offset) - first + 1;
        if (!(count < MOST_SAMPLES)) return;  // it never leaves
        float reached = 0;
        for (std::int64_t k = 0; float(k) < count && reached < rays_.most; ++k) {
            const float depth = (first + float(k) + offset) * step;
            float point[3];
            std::int64_t cell[3];
            if (!find(origin, direction, depth, point, cell) || !density_.near(cell)) continue;
            const Corners corners(density_.shape, cell, point);
            const float here = density_.at(corners);
            if (!(here > 0)) continue;  // on the very border of the smoke, or by rounding beyond it
            take(point, corners, here, depth);
            reached += here * rays_.extinction;
        }
    }

private:
    // The point at a depth and the cell below it; false for what no rounding explains.
    bool find(const float* origin, const float* direction, float depth, float point[3],
              std::int64_t cell[3]) const {
        for (int axis = 0; axis < 3; ++axis) {
            point[axis] = origin[axis] + depth * direction[axis];
            if (!(point[axis] > rays_.lower[axis] - 1 && point[axis] < rays_.upper[axis] + 1))
                return false;
            cell[axis] = below(point[axis]);
        }
        return true;
    }

    const Density& density_;
    const Rays& rays_;
};

// The samples of all rays, ray by ray, near to far.
inline Sampled march(const Density& density, const Rays& rays, int threads) {
    const Ranges ranges(rays.count, RAYS_AT_ONCE);
    std::vector<Sampled> found(ranges.count);
    ThreadPool& pool = ThreadPool::of_process();
    pool.run(ranges.count, threads, [&](int range, int) {
        const Marching marching(density, rays);
        Sampled& to = found[range];
        for (std::int64_t ray = ranges.begin(range); ray < ranges.end(range); ++ray) {
            to.starts.push_back(std::int64_t(to.depth.size()));
            marching.along(ray, [&](const float point[3], const Corners&, float here, float depth) {
                to.points.insert(to.points.end(), point, point + 3);
                to.depth.push_back(depth);
                to.density.push_back(here);
            });
        }
    });
    Sampled all;
    std::vector<std::int64_t> begins(ranges.count + 1, 0);
    for (int range = 0; range < ranges.count; ++range)
        begins[range + 1] = begins[range] + std::int64_t(found[range].depth.size());
    all.starts.resize(rays.count + 1);
    all.points.resize(3 * begins.back());
    all.depth.resize(begins.back());
    all.density.resize(begins.back());
    pool.run(ranges.count, threads, [&](int range, int) {
        Sampled& from = found[range];
        for (std::size_t ray = 0; ray < from.starts.size(); ++ray)
            all.starts[ranges.begin(range) + std::int64_t(ray)] = begins[range] + from.starts[ray];
        std::copy(from.points.begin(), from.points.end(), all.points.begin() + 3 * begins[range]);
        std::copy(from.depth.begin(), from.depth.end(), all.depth.begin() + begins[range]);
        std::copy(from.density.begin(), from.density.end(), all.density.begin() + begins[range]);
        from = {};
    });
    all.starts.back() = begins.back();
    return all;
}

// What samples show: ray r has those from starts[r] to starts[r + 1].
struct Shading {
    const std::int64_t* starts;
    std::int64_t rays;
    const float *density, *colour, *depth;  // [samples], [samples, 3], [samples]
    float extinction;                       // of density one, in a step
    bool paper;                             // the integrand as the VNCA paper prints it
};

// A sample's share of the light of its ray, and what is left of the light behind it.
struct Weighed {
    float weight, through, change;  // `change` is d weight / d optical depth (or density) of itself

    Weighed(const Shading& shading, std::int64_t sample, float before) {
        const float density = shading.density[sample], thickness = shading.extinction * density;
        const float passes = std::exp(-thickness);
        through = before * passes;
        weight = shading.paper ? density * through : before * -std::expm1(-thickness);
        change = shading.paper ? through : through * shading.extinction;
    }
};

constexpr float THINNEST = 1e-12f;

// To `colour` [rays, 3], what passes through [rays], and the mean depth [rays] of what is seen.
inline void composite(const Shading& from, float* colour, float* passes, float* depth, int threads) {
    const Ranges ranges(from.rays, RAYS_AT_ONCE);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        for (std::int64_t ray = ranges.begin(range); ray < ranges.end(range); ++ray) {
            float through = 1, total = 0, deep = 0, sum[3] = {};
            for (std::int64_t i = from.starts[ray]; i < from.starts[ray + 1]; ++i) {
                const Weighed here(from, i, through);
                through = here.through;
                total += here.weight;
                deep += here.weight * from.depth[i];
                for (int c = 0; c < 3; ++c) sum[c] += here.weight * from.colour[3 * i + c];
            }
            std::copy_n(sum, 3, colour + 3 * ray);
            passes[ray] = through;
            depth[ray] = total > THINNEST ? deep / total : INFINITY;
        }
    });
}

// Gradients of the density [samples] and the colours [samples, 3] of samples from those of the colour of
// rays [rays, 3] and of what passes [rays].
inline void composite_backward(const Shading& from, const float* to_colour, const float* to_passes,
                               float* to_density, float* to_hue, int threads) {
    const Ranges ranges(from.rays, RAYS_AT_ONCE);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        std::vector<Weighed> ray_of;
        for (std::int64_t ray = ranges.begin(range); ray < ranges.end(range); ++ray) {
            const std::int64_t begin = from.starts[ray], end = from.starts[ray + 1];
            const float* const g = to_colour + 3 * ray;
            float through = 1;
            ray_of.clear();
            for (std::int64_t i = begin; i < end; ++i) {
                ray_of.emplace_back(from, i, through);
                through = ray_of.back().through;
            }
            // What a sample takes from all behind it, and from the background.
            float behind = through * to_passes[ray];
            for (std::int64_t i = end; i-- > begin;) {
                const Weighed& here = ray_of[i - begin];
                float seen = 0;
                for (int c = 0; c < 3; ++c) {
                    seen += g[c] * from.colour[3 * i + c];
                    to_hue[3 * i + c] = here.weight * g[c];
                }
                if (from.paper) behind += here.weight * seen;  // it absorbs its own light, too
                to_density[i] = here.change * seen - from.extinction * behind;
                if (!from.paper) behind += here.weight * seen;
            }
        }
    });
}

}  // namespace vnca
