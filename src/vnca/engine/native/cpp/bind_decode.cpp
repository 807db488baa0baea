// The Python side of native decoding: checks every array, then works without the interpreter.

#include "bind_decode.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "decode.hpp"

namespace vnca {
namespace {

constexpr std::int64_t MOST_UNITS = 128;

// Weights and bias of each layer in turn.
using InputWeights = std::array<Input, 2 * LAYERS>;
using OutputWeights = std::array<Output, 2 * LAYERS>;

constexpr const char* NAMES[2 * LAYERS] = {"first weights",  "first bias",  "second weights",
                                           "second bias",    "third weights", "third bias",
                                           "output weights", "output bias"};

Decoder checked(const Input& state, const InputWeights& weights) {
    const std::int64_t rows = length(state, 0), channels = length(state, 1),
                       units = length(weights[0], 0);
    Decoder decoder;
    decoder.state = data_of<float>(state, "state", {ANY, ANY});
    in_range("cells", rows - 1, 0, INT32_MAX - 1);
    in_range("channels", channels, SHOWN, MOST_CHANNELS);
    in_range("units of a layer", units, 1, MOST_UNITS);
    decoder.cells = rows - 1;
    decoder.channels = int(channels);
    for (int l = 0; l < LAYERS; ++l) {
        const std::int64_t inputs = l == 0 ? channels : units;
        const std::int64_t outputs = l == LAYERS - 1 ? SHOWN : units;
        decoder.layers[l] = {int(inputs), int(outputs),
                             data_of<float>(weights[2 * l], NAMES[2 * l], {outputs, inputs}),
                             data_of<float>(weights[2 * l + 1], NAMES[2 * l + 1], {outputs})};
    }
    return decoder;
}

Scattered scattered(const Input& rows, const Input& fractions) {
    const std::int64_t points = length(fractions, 0);
    const float* const within = data_of<float>(fractions, "fractions", {ANY, 3});
    return {data_of<std::int32_t>(rows, "rows", {CORNERS, points}), within, points};
}

const DecodeKernel& kernel_named(const std::string& name) {
    for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel)
        if (name.empty() || name == (*kernel)->name) return **kernel;
    throw nb::value_error(("this machine does not run the native kernel for " + name).c_str());
}

const char* const WRONG_ROWS = "rows: expected rows of the state, from 0 to ";

// Works without the interpreter; `work` says whether all rows were in range.
template <class Work>
void require_valid(const Work& work, const char* wrong, const Decoder& decoder) {
    bool valid;
    {
        nb::gil_scoped_release released;
        valid = work();
    }
    if (!valid) throw nb::value_error((wrong + std::to_string(decoder.cells)).c_str());
}

std::vector<Extent> extents(const Input& state, const InputWeights& weights,
                            std::initializer_list<Extent> others) {
    std::vector<Extent> all(others);
    all.emplace_back(state);
    all.insert(all.end(), weights.begin(), weights.end());
    return all;
}

}  // namespace

void bind_decode(nb::module_& m) {
    m.def("decode_instructions", [] {
        std::vector<std::string> names;
        for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel)
            names.emplace_back((*kernel)->name);
        return names;
    });

    m.def("decode_forward", [](Input state, Input rows, Input fractions,
                               const InputWeights& weights, Output out, int threads,
                               const std::string& instructions) {
        const Decoder decoder = checked(state, weights);
        const Scattered source = scattered(rows, fractions);
        float* const to = data_of<float>(out, "out", {source.count, SHOWN});
        check_apart({out}, extents(state, weights, {rows, fractions}));
        const DecodeKernel& kernel = kernel_named(instructions);
        require_valid([&] { return decode(kernel, decoder, source, to, threads); }, WRONG_ROWS,
                      decoder);
    });

    m.def("decode_parts", [](Input state, Input cells, Input neighbours, int parts, int samples,
                             const InputWeights& weights, float most, Output colour, Output change,
                             int threads, const std::string& instructions) {
        const Decoder decoder = checked(state, weights);
        in_range("parts along a cell", parts, 1, Subdivided::FINEST);
        in_range("points along a cell", std::int64_t(parts) * samples, parts, Subdivided::FINEST);
        const std::int64_t count = length(cells, 0);
        const std::int32_t* const around =
            data_of<std::int32_t>(neighbours, "neighbours", {NEIGHBOURS, decoder.cells});
        const Subdivided source(data_of<std::int32_t>(cells, "cells", {ANY}), count, around,
                                parts * samples);
        const Shown to = {
            samples, most, data_of<float>(colour, "colour", {count, parts, parts, parts, SHOWN - 1}),
            data_of<float>(change, "change", {count, parts, parts, parts})};
        check_apart({colour, change}, extents(state, weights, {cells, neighbours}));
        const DecodeKernel& kernel = kernel_named(instructions);
        require_valid([&] { return decode_parts(kernel, decoder, source, to, threads); },
                      "cells or neighbours: expected cells, and rows of the state, below and up to ",
                      decoder);
    });

    m.def("show", [](Input seen, float most, Output colour, Output factor, int threads,
                     const std::string& instructions) {
        const std::int64_t points = length(seen, 0);
        const float* const from = data_of<float>(seen, "what is seen", {points, SHOWN});
        float* const light = data_of<float>(colour, "colour", {points, SHOWN - 1});
        float* const of_density = data_of<float>(factor, "factor", {points});
        check_apart({colour, factor}, {seen});
        const DecodeKernel& kernel = kernel_named(instructions);
        nb::gil_scoped_release released;
        show(kernel, from, points, most, light, of_density, threads);
    });

    m.def("show_backward", [](Input seen, float most, Input of_colour, Input of_factor,
                              Output gradient, int threads, const std::string& instructions) {
        const std::int64_t points = length(seen, 0);
        const float* const from = data_of<float>(seen, "what is seen", {points, SHOWN});
        const auto* const light = data_of<float>(of_colour, "gradient of colour", {points, SHOWN - 1});
        const auto* const of_density = data_of<float>(of_factor, "gradient of factor", {points});
        float* const to = data_of<float>(gradient, "gradient", {points, SHOWN});
        check_apart({gradient}, {seen, of_colour, of_factor});
        const DecodeKernel& kernel = kernel_named(instructions);
        nb::gil_scoped_release released;
        show_backward(kernel, from, points, most, light, of_density, to, threads);
    });

    m.def("decode_backward", [](Input state, Input rows, Input fractions,
                                const InputWeights& weights, Input gradient, Output to_state,
                                const OutputWeights& to_weights, int threads,
                                const std::string& instructions) {
        const Decoder decoder = checked(state, weights);
        const Scattered source = scattered(rows, fractions);
        const DecodeKernel& kernel = kernel_named(instructions);
        const float* const from = data_of<float>(gradient, "gradient", {source.count, SHOWN});
        DecodeGradients to;
        to.state = data_of<float>(to_state, "gradient of the state",
                                  {decoder.cells + 1, decoder.channels});
        for (int l = 0; l < LAYERS; ++l) {
            const Layer& layer = decoder.layers[l];
            to.weights[l] = data_of<float>(to_weights[2 * l], "gradient of the weights",
                                           {layer.outputs, layer.inputs});
            to.biases[l] = data_of<float>(to_weights[2 * l + 1], "gradient of a bias",
                                          {layer.outputs});
        }
        std::vector<Extent> outputs(to_weights.begin(), to_weights.end());
        outputs.emplace_back(to_state);
        check_apart(outputs, extents(state, weights, {rows, fractions, gradient}));
        require_valid([&] { return decode_backward(kernel, decoder, source, from, to, threads); },
                      WRONG_ROWS, decoder);
    });
}

}  // namespace vnca
