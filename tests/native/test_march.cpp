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
#include "film.hpp"
#include "march.hpp"
#include "smear.hpp"

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

struct Seen {
    std::vector<float> pixels, passes;
    bool operator==(const Seen&) const = default;
};

Seen filmed(const Smoke& smoke, const std::vector<float>& colour, const Light* light, const Rays& rays,
            int threads) {
    Seen seen = {std::vector<float>(3 * rays.count), std::vector<float>(rays.count)};
    film(smoke.density, colour.data(), light, rays, seen.pixels.data(), seen.passes.data(), threads);
    return seen;
}

// Smoke of many colours, and a light of which a third is left in the shadow.
struct Lit {
    Smoke smoke;
    std::vector<float> colour, shadow;
    Light light;

    Lit() : smoke(17, 23, 19, 0), colour(3 * 17 * 23 * 19), shadow(6 * 7 * 5, 0.5f) {
        smoke.make_random(5);
        for (std::size_t i = 0; i < colour.size(); ++i) colour[i] = 0.5f + 0.5f * std::sin(float(i));
        light = {shadow.data(), {6, 7, 5}, {4, 4, 4}, {4, 4, 4}, 0.75f};
    }
};

void films_are_what_samples_add_up_to() {
    Lit lit;
    std::fill(lit.colour.begin(), lit.colour.end(), 0.5f);
    Beams beams(lit.smoke, 500, 6);
    // Within all of the light's cells even smoke is lit evenly.
    lit.shadow.assign(20 * 20 * 20, 0.5f);
    lit.light = {lit.shadow.data(), {20, 20, 20}, {20, 20, 20}, {4, 4, 4}, 0.75f};
    const Seen glowing = filmed(lit.smoke, lit.colour, nullptr, beams.rays, 1);
    const Seen seen = filmed(lit.smoke, lit.colour, &lit.light, beams.rays, 2);
    const Sampled found = march(lit.smoke.density, beams.rays, 1);
    const std::vector<float> grey(found.points.size(), 0.5f);
    std::vector<float> colour(3 * 500), passes(500), depth(500);
    composite({found.starts.data(), 500, found.density.data(), grey.data(), found.depth.data(), 1, false},
              colour.data(), passes.data(), depth.data(), 1);
    for (int ray = 0; ray < 500; ++ray) {
        expect(std::abs(glowing.passes[ray] - passes[ray]) < 1e-6f, "films pass as much");
        expect(std::abs(glowing.pixels[3 * ray] - colour[3 * ray]) < 1e-5f, "films glow the same");
        expect(std::abs(seen.pixels[3 * ray] - 0.25f * glowing.pixels[3 * ray]) < 1e-5f,
               "light is multiplied with colours");
    }
}

void films_are_the_same_of_callers() {
    const Lit lit;
    const Beams beams(lit.smoke, 3000, 6);
    expect_the_same_of_callers([&](int threads) {
        return filmed(lit.smoke, lit.colour, &lit.light, beams.rays, threads);
    });
}

void smearing_stays_in_the_picture() {
    constexpr std::int64_t ROWS = 13, COLUMNS = 17;
    const std::vector<float> even(ROWS * COLUMNS * CHANNELS, 0.25f);
    std::vector<float> ways(2 * ROWS * COLUMNS), result(even.size());
    for (const float longest : {0.0f, 0.01f, 3.0f, 1e6f, 1e30f}) {
        for (std::size_t i = 0; i < ways.size(); ++i) ways[i] = longest * std::sin(float(i));
        for (const int threads : {1, 3}) {
            smear(even.data(), ways.data(), ROWS, COLUMNS, 9, 0.05f, result.data(), threads);
            for (const float value : result)
                expect(std::abs(value - 0.25f) < 1e-6f, "what is even stays so");
        }
    }
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
    Smoke thin(3, 3, 3, 1e-20f);
    Beams still(thin, 300, 1);
    for (int ray = 0; ray < 300; ++ray)
        for (int axis = 0; axis < 3; ++axis) {
            still.origins[3 * ray + axis] = 1;
            still.directions[3 * ray + axis] = ray % 2 ? 0.0f : 1e-20f;
        }
    expect(march(thin.density, still.rays, 2).depth.empty(), "rays that stay end");
    const Lit lit;
    for (const float first : odd)
        for (const float times : odd) {
            Light light = lit.light;
            light.first[1] = first;
            light.times[2] = times;
            const Beams beams(lit.smoke, 300, 1);
            for (const float passes : filmed(lit.smoke, lit.colour, &light, beams.rays, 2).passes)
                expect(passes >= 0 && passes <= 1, "a light from nowhere leaves smoke as it is");
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
    films_are_what_samples_add_up_to();
    films_are_the_same_of_callers();
    smearing_stays_in_the_picture();
    what_is_wrong_is_left_out();
    std::puts("marching: all hold");
}
