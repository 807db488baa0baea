// The Python side of native marching: checks every array, then works without the interpreter.

#include "bind_march.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>

#include <array>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>

#include "arrays.hpp"
#include "film.hpp"
#include "march.hpp"
#include "smear.hpp"

namespace vnca {
namespace {

using Place = std::array<std::int64_t, 3>;
using Point = std::array<float, 3>;

Density checked_density(const Input& density, const Input& near) {
    Density smoke = {data_of<float>(density, "density", {ANY, ANY, ANY}), {}, nullptr};
    for (int axis = 0; axis < 3; ++axis) {
        smoke.shape[axis] = length(density, axis);
        in_range("cells along an axis", smoke.shape[axis], 1, INT32_MAX);
    }
    smoke.near_smoke = data_of<std::uint8_t>(
        near, "near", {smoke.shape[0] + 1, smoke.shape[1] + 1, smoke.shape[2] + 1});
    return smoke;
}

Rays checked_rays(const Density& smoke, const Input& origins, const Input& directions,
                  const Input& offsets, const Point& lower, const Point& upper, float nearest, float step,
                  float extinction, float most) {
    const std::int64_t rays = length(origins, 0), apart = length(offsets, 0) == 1 ? 0 : 1;
    if (!(step > 0)) throw nb::value_error("step: expected more than zero");
    Rays along = {data_of<float>(origins, "origins", {rays, 3}),
                  data_of<float>(directions, "directions", {rays, 3}),
                  data_of<float>(offsets, "offsets", {apart ? rays : 1}),
                  rays, apart, {}, {}, nearest, step, extinction, most};
    // Inside of the smoke's own box, so that every step is in reach of a counter.
    for (int axis = 0; axis < 3; ++axis) {
        along.lower[axis] = std::max(lower[axis], -1.0f);
        along.upper[axis] = std::min(upper[axis], float(smoke.shape[axis]));
    }
    return along;
}

// Shadow, where it lies, and what there is without it.
using Lit = std::tuple<Input, Point, Point, float>;

Light checked_light(const Lit& lit) {
    const auto& [shadow, first, times, full] = lit;
    Light light = {data_of<float>(shadow, "shadow", {ANY, ANY, ANY}), {}, {}, {}, full};
    for (int axis = 0; axis < 3; ++axis) {
        light.shape[axis] = length(shadow, axis);
        in_range("cells of shadow along an axis", light.shape[axis], 1, INT32_MAX);
        light.first[axis] = first[axis];
        light.times[axis] = times[axis];
    }
    return light;
}

// An array that owns what it is made of.
template <class T>
nb::ndarray<nb::numpy, T> owned(std::vector<T>&& values, std::size_t columns) {
    auto* const kept = new std::vector<T>(std::move(values));
    const nb::capsule owner(kept, [](void* it) noexcept { delete static_cast<std::vector<T>*>(it); });
    if (columns == 1) return nb::ndarray<nb::numpy, T>(kept->data(), {kept->size()}, owner);
    return nb::ndarray<nb::numpy, T>(kept->data(), {kept->size() / columns, columns}, owner);
}

Shading checked_shading(const Input& starts, const Input& density, const Input& colour,
                        const Input& depth, float extinction, bool paper) {
    const std::int64_t rays = length(starts, 0) - 1, samples = length(density, 0);
    in_range("rays", rays, 0, INT64_MAX / 8);
    const Shading shading = {data_of<std::int64_t>(starts, "starts", {rays + 1}),
                             rays,
                             data_of<float>(density, "density", {samples}),
                             data_of<float>(colour, "colour", {samples, 3}),
                             data_of<float>(depth, "depth", {samples}),
                             extinction,
                             paper};
    bool ordered = shading.starts[0] == 0 && shading.starts[rays] == samples;
    for (std::int64_t ray = 0; ordered && ray < rays; ++ray)
        ordered = shading.starts[ray] <= shading.starts[ray + 1];
    if (!ordered) throw nb::value_error("starts: expected them to ascend from 0 to all samples");
    return shading;
}

}  // namespace

void bind_march(nb::module_& m) {
    m.def("find_smoke", [](Input density, Output near, int threads) {
        const float* const from = data_of<float>(density, "density", {ANY, ANY, ANY});
        std::int64_t shape[3];
        for (int axis = 0; axis < 3; ++axis) shape[axis] = length(density, axis);
        auto* const to = data_of<std::uint8_t>(near, "near", {shape[0] + 1, shape[1] + 1, shape[2] + 1});
        check_apart({near}, {density});
        Bounds bounds;
        {
            nb::gil_scoped_release released;
            bounds = find_smoke(from, shape, to, threads);
        }
        return std::pair(Place{bounds.least[0], bounds.least[1], bounds.least[2]},
                         Place{bounds.most[0], bounds.most[1], bounds.most[2]});
    });

    m.def("march", [](Input density, Input near, Input origins, Input directions, Input offsets,
                      const Point& lower, const Point& upper, float nearest, float step,
                      float extinction, float most, int threads) {
        const Density smoke = checked_density(density, near);
        const Rays along = checked_rays(smoke, origins, directions, offsets, lower, upper, nearest, step,
                                        extinction, most);
        Sampled found;
        {
            nb::gil_scoped_release released;
            found = march(smoke, along, threads);
        }
        return nb::make_tuple(owned(std::move(found.starts), 1), owned(std::move(found.points), 3),
                              owned(std::move(found.depth), 1), owned(std::move(found.density), 1));
    });

    m.def("film", [](Input density, Input near, Input colour, const std::optional<Lit>& lit, Input origins,
                     Input directions, Input offsets, const Point& lower, const Point& upper,
                     float nearest, float step, float extinction, float most, Output to_colour,
                     Output passes, int threads) {
        const Density smoke = checked_density(density, near);
        const float* const hue = data_of<float>(
            colour, "colour", {smoke.shape[0], smoke.shape[1], smoke.shape[2], 3});
        const Rays along = checked_rays(smoke, origins, directions, offsets, lower, upper, nearest, step,
                                        extinction, most);
        const std::optional<Light> light = lit ? std::optional(checked_light(*lit)) : std::nullopt;
        float* const pixels = data_of<float>(to_colour, "colour of rays", {along.count, 3});
        float* const through = data_of<float>(passes, "what passes", {along.count});
        std::vector<Extent> inputs = {density, near, colour, origins, directions, offsets};
        if (lit) inputs.emplace_back(std::get<0>(*lit));
        check_apart({to_colour, passes}, inputs);
        nb::gil_scoped_release released;
        film(smoke, hue, light ? &*light : nullptr, along, pixels, through, threads);
    });

    m.def("smear", [](Input picture, Input way, std::int64_t count, float still, Output to, int threads) {
        const std::int64_t rows = length(picture, 0), columns = length(picture, 1);
        const float* const from = data_of<float>(picture, "picture", {ANY, ANY, CHANNELS});
        const float* const ways = data_of<float>(way, "ways", {rows, columns, 2});
        float* const smeared = data_of<float>(to, "smeared picture", {rows, columns, CHANNELS});
        in_range("rows", rows, 1, INT32_MAX);
        in_range("columns", columns, 1, INT32_MAX);
        in_range("places on a way", count, 1, INT32_MAX);
        bool finite = true;
        for (std::int64_t i = 0; i < 2 * rows * columns; ++i) finite &= std::isfinite(ways[i]);
        if (!finite) throw nb::value_error("ways: expected finite numbers");
        check_apart({to}, {picture, way});
        nb::gil_scoped_release released;
        smear(from, ways, rows, columns, count, still, smeared, threads);
    });

    m.def("composite", [](Input starts, Input density, Input colour, Input depth, float extinction,
                          bool paper, Output to_colour, Output passes, Output to_depth, int threads) {
        const Shading from = checked_shading(starts, density, colour, depth, extinction, paper);
        float* const light = data_of<float>(to_colour, "colour of rays", {from.rays, 3});
        float* const through = data_of<float>(passes, "what passes", {from.rays});
        float* const deep = data_of<float>(to_depth, "depth of rays", {from.rays});
        check_apart({to_colour, passes, to_depth}, {starts, density, colour, depth});
        nb::gil_scoped_release released;
        composite(from, light, through, deep, threads);
    });

    m.def("composite_backward", [](Input starts, Input density, Input colour, Input depth,
                                   float extinction, bool paper, Input of_colour, Input of_passes,
                                   Output to_density, Output to_colour, int threads) {
        const Shading from = checked_shading(starts, density, colour, depth, extinction, paper);
        const std::int64_t samples = from.starts[from.rays];
        const float* const light = data_of<float>(of_colour, "gradient of colours", {from.rays, 3});
        const float* const through = data_of<float>(of_passes, "gradient of what passes", {from.rays});
        float* const dense = data_of<float>(to_density, "gradient of the density", {samples});
        float* const hue = data_of<float>(to_colour, "gradient of the samples", {samples, 3});
        check_apart({to_density, to_colour}, {starts, density, colour, depth, of_colour, of_passes});
        nb::gil_scoped_release released;
        composite_backward(from, light, through, dense, hue, threads);
    });
}

}  // namespace vnca
