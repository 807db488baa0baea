// The Python side of the native step: checks every array, then works without the interpreter.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "bind_carry.hpp"
#include "bind_decode.hpp"
#include "bind_march.hpp"
#include "fill.hpp"
#include "mask.hpp"
#include "step.hpp"
#include "thread_pool.hpp"

using namespace vnca;

namespace {

constexpr std::int64_t MOST_HIDDEN = 512, MOST_PRIORS = 16;

// Each filter's scale over its integer form.
void read_scales(const float* stencil, float* scale) {
    static constexpr int SMOOTH[3] = {1, 2, 1}, LAPLACIAN[4] = {-88, 6, 3, 2};
    static constexpr int SAMPLE[FILTERS] = {13, 22, 16, 14, 14};  // a weight that is not zero
    for (int filter = 0; filter < FILTERS; ++filter) {
        float form[NEIGHBOURS];
        for (int o = 0; o < NEIGHBOURS; ++o) {
            const int x = o / 9 - 1, y = o / 3 % 3 - 1, z = o % 3 - 1;
            const int sobel[3] = {x * SMOOTH[y + 1] * SMOOTH[z + 1],
                                  y * SMOOTH[x + 1] * SMOOTH[z + 1],
                                  z * SMOOTH[x + 1] * SMOOTH[y + 1]};
            const int distance = std::abs(x) + std::abs(y) + std::abs(z);
            form[o] = float(filter == 0   ? distance == 0
                            : filter == 4 ? LAPLACIAN[distance]
                                          : sobel[filter - 1]);
        }
        const float* const weights = stencil + filter * NEIGHBOURS;
        scale[filter] = weights[SAMPLE[filter]] / form[SAMPLE[filter]];
        for (int o = 0; o < NEIGHBOURS; ++o)
            if (!(std::abs(weights[o] - scale[filter] * form[o]) <=
                  1e-6f * std::abs(scale[filter] * form[o])))
                throw nb::value_error(
                    "stencil: the native kernel knows only multiples of the identity, the three "
                    "Sobel filters and the 27-point Laplacian");
    }
}

// The arrays of a step, checked but for where neighbours are.
Step step_of(std::int64_t n, const Input& state, const Input& priors, const Input& first,
             const Input& bias, const Input& second, const Input& stencil,
             const std::optional<Input>& steering) {
    const std::int64_t c = length(state, 1), p = length(priors, 1), h = length(first, 0);
    Step step;
    step.state = data_of<float>(state, "state", {n + 1, c == 0 ? ANY : c});
    step.neighbours = nullptr;
    step.prior_values = data_of<float>(priors, "priors", {n, priors.ndim() == 2 ? p : ANY});
    in_range("cells", n, 0, INT32_MAX - 1);
    in_range("channels", c, 1, MOST_CHANNELS);
    in_range("hidden units", h, 1, MOST_HIDDEN);
    in_range("priors", p, 0, MOST_PRIORS);
    step.first = data_of<float>(first, "hidden weights", {h, FILTERS * c + p});
    step.bias = data_of<float>(bias, "hidden bias", {h});
    step.second = data_of<float>(second, "output weights", {c, h});
    read_scales(data_of<float>(stencil, "stencil", {FILTERS, NEIGHBOURS}), step.scale);
    if (steering) {
        step.steering = data_of<float>(*steering, "steering", {n, 3, 3});
        // Turned as whole numbers, see `perceive`.
        if (step.scale[1] != step.scale[2] || step.scale[1] != step.scale[3])
            throw nb::value_error("stencil: to steer, the Sobel filters must have one divisor");
    }
    step.cells = n;
    step.channels = int(c);
    step.hidden = int(h);
    step.priors = int(p);
    return step;
}

// A step of listed rows, checked but for the range of rows and neighbours.
struct Arrays {
    Step step;
    Rows rows;

    Arrays(const Input& state, const Input& rows_array, const Input& neighbours,
           const Input& priors, const Input& first, const Input& bias, const Input& second,
           const Input& stencil, const std::optional<Input>& steering)
        : step(step_of(length(neighbours, 1), state, priors, first, bias, second, stencil,
                       steering)) {
        step.neighbours =
            data_of<std::int32_t>(neighbours, "neighbours", {NEIGHBOURS, step.cells});
        rows = {data_of<std::int32_t>(rows_array, "rows", {ANY}), length(rows_array, 0)};
    }

    // Rows must be checked before use.
    void check_rows() const {
        bool ascending = true;
        for (std::int64_t i = 1; i < rows.count; ++i)
            ascending &= rows.data[i - 1] < rows.data[i];
        if (!ascending) throw nb::value_error("rows: expected ascending numbers, each at most once");
        if (rows.count > 0 && (rows.data[0] < 0 || rows.data[rows.count - 1] >= step.cells))
            throw nb::value_error(("rows: expected numbers of cells, from 0 to " +
                                   std::to_string(step.cells - 1)).c_str());
    }

    void check_neighbours(bool valid) const {
        if (!valid)
            throw nb::value_error(("neighbours: expected rows of the state, from 0 to " +
                                   std::to_string(step.cells)).c_str());
    }
};

// Places in memory, and that of an array that may not be there.
std::vector<Extent> with(std::vector<Extent> extents, const std::optional<Input>& array) {
    if (array) extents.emplace_back(*array);
    return extents;
}

// Kernels that this machine can run and that multiply numbers of the given kind, fastest first.
std::vector<const Kernel*> kernels_for(bool bfloat16) {
    std::vector<const Kernel*> found;
    for (const Kernel* const* kernel = kernels(); *kernel != nullptr; ++kernel)
        if ((*kernel)->bfloat16 == bfloat16) found.push_back(*kernel);
    return found;
}

const Kernel& kernel_named(const std::string& name, bool bfloat16) {
    for (const Kernel* const kernel : kernels_for(bfloat16))
        if (name.empty() || name == kernel->name) return *kernel;
    throw nb::value_error(("this machine does not run the native kernel for " +
                           (name.empty() ? "bfloat16" : name)).c_str());
}

}  // namespace

NB_MODULE(_native, m) {
    m.doc() = "The native kernels; see the native.py of each operation.";
    bind_carry(m);
    bind_march(m);
    bind_decode(m);

    m.def("instructions", [](bool bfloat16) {
        std::vector<std::string> names;
        for (const Kernel* const kernel : kernels_for(bfloat16)) names.emplace_back(kernel->name);
        return names;
    });

    m.def("multiply_adds", [](std::int64_t rounds, int threads, bool bfloat16,
                              const std::string& instructions) {
        const Kernel& kernel = kernel_named(instructions, bfloat16);
        std::atomic<double> operations = 0;
        nb::gil_scoped_release released;
        ThreadPool::of_process().run(threads, threads, [&](int, int) {
            operations += kernel.multiply_adds(rounds);
        });
        return operations.load();
    });

    m.def("fill", [](Output values, Input known, Input cells, Input beside, int threads) {
        const std::int64_t bricks = length(beside, 1), count = length(cells, 0);
        const std::int64_t places = (bricks + 1) * Filling::BRICK;
        const Filling filling = {
            bricks, data_of<float>(values, "values", {places, 3}),
            data_of<std::uint8_t>(known, "known", {places}),
            data_of<std::int64_t>(beside, "bricks beside", {Filling::WAYS, bricks})};
        const auto* const to_fill = data_of<std::int64_t>(cells, "cells", {count});
        check_apart({values}, {known, cells, beside});
        bool valid;
        {
            nb::gil_scoped_release released;
            valid = fill(filling, to_fill, count, threads);
        }
        if (!valid) throw nb::value_error("cells: expected places of unknown cells, and of bricks");
    });

    m.def("changing_rows", [](Input hashes, std::uint32_t key, std::uint32_t threshold, Output rows) {
        const std::int64_t n = length(hashes, 0);
        const auto* const from = data_of<std::int32_t>(hashes, "hashes", {ANY});
        auto* const to = data_of<std::int32_t>(rows, "rows", {n});
        check_apart({rows}, {hashes});
        nb::gil_scoped_release released;
        return changing_rows({from, key, threshold}, n, to);
    });

    m.def("forward", [](Input state, Input rows, Input neighbours, Input priors, Input first,
                        Input bias, Input second, Input stencil, const std::optional<Input>& steering,
                        Output out, int threads, bool bfloat16, const std::string& instructions) {
        const Arrays arrays(state, rows, neighbours, priors, first, bias, second, stencil, steering);
        const Step& step = arrays.step;
        const Kernel& kernel = kernel_named(instructions, bfloat16);
        float* const to = data_of<float>(out, "out", {step.cells + 1, step.channels});
        check_apart({out}, with({state, rows, neighbours, priors, first, bias, second, stencil},
                                steering));
        bool valid;
        {
            nb::gil_scoped_release released;
            arrays.check_rows();
            valid = forward(kernel, step, arrays.rows, to, threads);
        }
        arrays.check_neighbours(valid);
    });

    m.def("forward_bricks", [](Input state, Input around, Input places, Input hashes,
                               std::uint32_t key, std::uint32_t threshold, bool all, Input priors,
                               Input first, Input bias, Input second, Input stencil,
                               const std::optional<Input>& steering, Output out, int threads,
                               bool bfloat16, const std::string& instructions) {
        const std::int64_t n = length(places, 0), count = length(around, 0);
        const Step step = step_of(n, state, priors, first, bias, second, stencil, steering);
        const Kernel& kernel = kernel_named(instructions, bfloat16);
        const Bricks bricks = {
            count,
            data_of<std::int32_t>(around, "rows around bricks",
                                  {count, HALO_EDGE, HALO_EDGE, HALO_EDGE}),
            data_of<std::int32_t>(places, "places in bricks", {n}),
        };
        const auto* const hashed = data_of<std::int32_t>(hashes, "hashes", {n});
        const Mask mask = {all ? nullptr : hashed, key, threshold};
        float* const to = data_of<float>(out, "out", {step.cells + 1, step.channels});
        check_apart({out}, with({state, around, places, hashes, priors, first, bias, second,
                                 stencil}, steering));
        bool valid;
        {
            nb::gil_scoped_release released;
            valid = forward(kernel, step, bricks, mask, to, threads);
        }
        if (!valid)
            throw nb::value_error(("bricks: expected rows of the state, from 0 to " +
                                   std::to_string(step.cells) + ", and places of cells in them")
                                      .c_str());
    });

    m.def("backward", [](Input state, Input rows, Input neighbours, Input priors, Input first,
                         Input bias, Input second, Input stencil,
                         const std::optional<Input>& steering, Input gradient, Output to_state,
                         Output to_first, Output to_bias, Output to_second, int threads,
                         bool bfloat16, const std::string& instructions) {
        const Arrays arrays(state, rows, neighbours, priors, first, bias, second, stencil, steering);
        const Step& step = arrays.step;
        const Kernel& kernel = kernel_named(instructions, bfloat16);
        const std::vector<std::int64_t> shape = {step.cells + 1, step.channels};
        const float* const from = data_of<float>(gradient, "gradient", shape);
        const Gradients to = {
            data_of<float>(to_state, "gradient of the state", shape),
            data_of<float>(to_first, "gradient of the hidden weights", {step.hidden, step.inputs()}),
            data_of<float>(to_bias, "gradient of the hidden bias", {step.hidden}),
            data_of<float>(to_second, "gradient of the output weights", {step.channels, step.hidden}),
        };
        check_apart({to_state, to_first, to_bias, to_second},
                    with({state, rows, neighbours, priors, first, bias, second, stencil, gradient},
                         steering));
        bool valid;
        {
            nb::gil_scoped_release released;
            arrays.check_rows();
            valid = backward(kernel, step, arrays.rows, from, to, threads);
        }
        arrays.check_neighbours(valid);
    });
}
