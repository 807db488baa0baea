// Native marching without Python: held to what is known of it exactly (a slab of even density passes
// exp(−its thickness), shares of light add up, gradients are differences), to the same bits whatever the
// number of threads, and to what it promises where something is wrong. Made to be run under sanitizers
// (`make sanitize`): arrays are exactly as large as they are told.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>
#include <vector>

#include "checks.hpp"
#include "march.hpp"

using namespace vnca;

namespace {

struct Smoke {
    std::vector<float> values;
    std::vector<std::uint8_t> near;
    Density density;
    Bounds bounds;

    Smoke(std::int64_t x, std::int64_t y, std::int64_t z, float even, int threads = 1)
        : values(std::size_t(x * y * z), even), near(std::size_t((x + 1) * (y + 1) * (z + 1))) {
        density = {values.data(), {x, y, z}, near.data()};
        find(threads);
    }

    void make_random(int seed) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> any(0, 1);
        for (float& value : values) value = any(random) < 0.5f ? 0 : 3 * any(random);
        find(2);
    }

    void find(int threads) { bounds = find_smoke(values.data(), density.shape, near.data(), threads); }
};

struct Beams {
    std::vector<float> origins, directions, offsets;
    Rays rays;

    Beams(const Smoke& smoke, std::int64_t count, int seed) : offsets(std::size_t(count)) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> any(0, 1);
        std::normal_distribution<float> way;
        for (std::int64_t ray = 0; ray < count; ++ray) {
            for (int axis = 0; axis < 3; ++axis) {
                const float d = way(random), at = any(random) * float(smoke.density.shape[axis]);
                directions.push_back(d);
                origins.push_back(at - 20 * d);
            }
            offsets[std::size_t(ray)] = any(random);
        }
        rays = {origins.data(), directions.data(), offsets.data(), count, 1, {}, {}, 0, 0.25f, 1, 7};
        for (int axis = 0; axis < 3; ++axis) {
            rays.lower[axis] = float(smoke.bounds.least[axis] - 1);
            rays.upper[axis] = float(smoke.bounds.most[axis] + 1);
        }
    }
};

void slabs_pass_what_they_should() {
    Smoke smoke(4, 4, 30, 0.3f);
    Beams beam(smoke, 1, 0);
    for (int axis = 0; axis < 3; ++axis) {
        beam.origins[axis] = axis == 2 ? -5.0f : 1.5f;
        beam.directions[axis] = axis == 2 ? 1.0f : 0.0f;
    }
    beam.rays.step = 0.01f;
    beam.rays.extinction = 0.01f;
    beam.rays.most = std::numeric_limits<float>::infinity();
    const Sampled found = march(smoke.density, beam.rays, 1);
    const std::vector<float> white(found.points.size(), 1.0f);
    float colour[3], passes, depth;
    composite({found.starts.data(), 1, found.density.data(), white.data(), found.depth.data(), 0.01f,
               false}, colour, &passes, &depth, 1);
    // 29 cells of it, and half of a cell at either end where it fades.
    expect(std::abs(passes - std::exp(-9.0f)) < 1e-5f, "a slab passes exp(-thickness)");
    expect(std::abs(colour[1] + passes - 1) < 1e-4f, "shares of light add up");
    expect(depth > 5 && depth < 10, "it is seen near its front");
}

struct Picture {
    std::vector<float> colour, passes, depth, density, hue;
    bool operator==(const Picture&) const = default;
};

Picture picture_of(const Sampled& found, std::int64_t rays, bool paper, int threads) {
    std::vector<float> hue(found.points.size());
    for (std::size_t i = 0; i < hue.size(); ++i) hue[i] = std::sin(found.points[i]);
    const Shading shading = {found.starts.data(), rays, found.density.data(), hue.data(),
                             found.depth.data(), 0.4f, paper};
    Picture result = {std::vector<float>(3 * rays), std::vector<float>(rays),
                      std::vector<float>(rays), std::vector<float>(found.depth.size()),
                      std::vector<float>(hue.size())};
    composite(shading, result.colour.data(), result.passes.data(), result.depth.data(), threads);
    composite_backward(shading, result.colour.data(), result.passes.data(), result.density.data(),
                       result.hue.data(), threads);
    return result;
}

// Half of the sum of the squares of a picture, whose gradient `picture_of` computes.
double energy(const Sampled& found, std::int64_t rays, bool paper) {
    const Picture picture = picture_of(found, rays, paper, 1);
    double sum = 0;
    for (const float value : picture.colour) sum += 0.5 * value * value;
    for (const float value : picture.passes) sum += 0.5 * value * value;
    return sum;
}

void gradients_are_differences(bool paper) {
    Smoke smoke(6, 5, 7, 0);
    smoke.make_random(3);
    const Beams beams(smoke, 20, 4);
    Sampled found = march(smoke.density, beams.rays, 1);
    const Picture picture = picture_of(found, 20, paper, 1);
    std::vector<float> got;
    std::vector<double> expected;
    for (std::size_t i = 0; i < found.density.size(); i += 3) {
        const float before = found.density[i], step = 0.02f;
        found.density[i] = before + step;
        const double above = energy(found, 20, paper);
        found.density[i] = before - step;
        const double below = energy(found, 20, paper);
        found.density[i] = before;
        got.push_back(picture.density[i]);
        expected.push_back((above - below) / (2 * step));
    }
    expect(got.size() > 20, "there are samples");
    expect(error(got, expected) < 2e-3, "gradients of the density are differences");
}

void threads_do_not_change_a_bit() {
    Smoke smoke(17, 23, 19, 0);
    smoke.make_random(5);
    const Beams beams(smoke, 3000, 6);
    expect_the_same_of_callers([&](int threads) {
        return picture_of(march(smoke.density, beams.rays, threads), 3000, false, threads);
    });
}

void what_is_wrong_is_left_out() {
    Smoke smoke(3, 3, 3, 1.0f);
    const float odd[] = {std::numeric_limits<float>::quiet_NaN(),
                         std::numeric_limits<float>::infinity(), -1e30f, 1e30f, 0.0f};
    for (const float origin : odd)
        for (const float direction : odd) {
            Beams beams(smoke, 300, 1);
            for (int ray = 0; ray < 300; ++ray) {
                beams.origins[3 * ray + ray % 3] = origin;
                beams.directions[3 * ray + ray / 3 % 3] = direction;
            }
            const Sampled found = march(smoke.density, beams.rays, 2);
            for (const float at : found.points)
                expect(at > -3 && at < 6, "samples lie in the smoke");
        }
    Smoke nothing(2, 3, 4, 0.0f);
    expect(nothing.bounds.least[0] > nothing.bounds.most[0], "there is no smoke");
    Smoke odd_values(2, 2, 2, std::numeric_limits<float>::quiet_NaN());
    expect(odd_values.bounds.most[0] == -1, "what is no number is no smoke");
}

}  // namespace

int main() {
    slabs_pass_what_they_should();
    gradients_are_differences(false);
    gradients_are_differences(true);
    threads_do_not_change_a_bit();
    what_is_wrong_is_left_out();
    std::puts("marching: all hold");
}
