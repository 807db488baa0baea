// The Python side of native carrying: checks every array, then works without the interpreter.

#include "bind_carry.hpp"

#include <nanobind/stl/array.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "arrays.hpp"
#include "carry.hpp"
#include "trace.hpp"

namespace vnca {

using Corner = std::array<std::int32_t, 3>;

static void check_box(const Corner& lower, const Corner& upper) {
    for (int axis = 0; axis < 3; ++axis)
        if (lower[axis] >= upper[axis]) throw nb::value_error("box: expected cells in it");
}

void bind_carry(nb::module_& m) {
    m.def("trace", [](Input velocity, Input bricks, const Corner& lower, const Corner& upper,
                      float least, Input cells, Input times, Output out, int threads) {
        const std::int64_t count = length(bricks, 0), wanted = length(cells, 0);
        in_range("bricks", count, 0, INT32_MAX / 2);
        check_box(lower, upper);
        const auto* const brick = data_of<std::int32_t>(bricks, "bricks", {count, 3});
        const auto* const values = data_of<float>(velocity, "velocity", {count, 8, 8, 8, 3});
        const auto* const cell = data_of<std::int32_t>(cells, "cells", {wanted, 3});
        const std::int64_t apart = length(times, 0) == 1 ? 0 : 1;
        const auto* const time = data_of<float>(times, "times", {apart ? wanted : 1});
        float* const to = data_of<float>(out, "out", {wanted, 3});
        check_apart({out}, {velocity, bricks, cells, times});
        nb::gil_scoped_release released;
        Tracing tracing = {{brick, count}, values, {}, {}, least};
        std::copy_n(lower.begin(), 3, tracing.lower);
        std::copy_n(upper.begin(), 3, tracing.upper);
        trace(tracing, cell, time, apart, wanted, to, threads);
    });

    m.def("carry", [](Input state, Input bricks, Input rows, const Corner& lower,
                      const Corner& upper, bool circular, float least, Input cells, Input moved,
                      Output out, int threads) {
        const std::int64_t n = length(state, 0) - 1, channels = length(state, 1);
        const std::int64_t count = length(bricks, 0), wanted = length(cells, 0);
        const float* const from = data_of<float>(state, "state", {ANY, ANY});
        in_range("cells", n, 0, INT32_MAX - 1);
        in_range("channels", channels, 1, MOST_CHANNELS);
        in_range("bricks", count, 0, INT32_MAX / 2);
        check_box(lower, upper);
        const auto* const brick = data_of<std::int32_t>(bricks, "bricks", {count, 3});
        const auto* const row = data_of<std::int32_t>(rows, "rows", {count, 8, 8, 8});
        const auto* const cell = data_of<std::int32_t>(cells, "cells", {wanted, 3});
        const float* const by = data_of<float>(moved, "movement", {wanted, 3});
        float* const to = data_of<float>(out, "out", {wanted + 1, channels});
        check_apart({out}, {state, bricks, rows, cells, moved});
        bool in_state, valid = false;
        {
            nb::gil_scoped_release released;
            in_state = std::all_of(row, row + count * RowsOfCells::BRICK,
                                   [&](std::int32_t r) { return r >= 0 && r <= n; });
            if (in_state) {
                Carrying carrying = {
                    from, int(channels), {brick, row, count, std::int32_t(n)}, {}, {}, circular, least};
                std::copy_n(lower.begin(), 3, carrying.lower);
                std::copy_n(upper.begin(), 3, carrying.upper);
                valid = carry(carrying, cell, by, wanted, to, threads);
            }
        }
        if (!in_state) throw nb::value_error("rows: expected rows of the state, or their number");
        if (!valid) throw nb::value_error("movement: expected finite numbers");
    });
}

}  // namespace vnca
