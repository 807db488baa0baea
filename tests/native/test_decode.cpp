// Native decoding without Python: held to a scalar one in double precision on odd shapes, to the
// same bits whatever the number of threads, and to what it promises where something is wrong. Made
// to be run under sanitizers (`make sanitize`): arrays are exactly as large as it is told.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "checks.hpp"
#include "decode.hpp"

using namespace vnca;

namespace {

// ---- Problems --------------------------------------------------------------------------------

struct Case {
    const char* name;
    std::int64_t points, cells;
    int channels, units;
    float frequency = 3;  // of the first layer; high ones leave the range of the polynomials
};

constexpr Case CASES[] = {
    {"one point", 1, 1, 4, 7},
    {"odd", 301, 77, 5, 17},
    {"several ranges", 4100, 2100, 12, 32},
    {"no point", 0, 10, 12, 32},
    {"no cell", 60, 0, 12, 32},
    {"wide", 97, 30, 64, 128},
    {"many channels", 49, 300, 20, 40},
    {"far out", 100, 50, 12, 16, 1e6f},
};

struct Problem {
    Case of;
    std::vector<std::int32_t> rows;
    std::vector<float> state, fractions, gradient, weights[LAYERS], biases[LAYERS];

    explicit Problem(const Case& c) : of(c) {
        std::mt19937 random(7);
        std::normal_distribution<float> normal;
        const auto draw = [&](std::size_t size, float scale) {
            std::vector<float> values(size);
            for (float& value : values) value = scale * normal(random);
            return values;
        };
        state = draw((c.cells + 1) * c.channels, 0.5f);
        std::fill(state.end() - c.channels, state.end(), 0.0f);
        rows.resize(CORNERS * c.points);
        for (std::int32_t& row : rows) row = std::int32_t(random() % (c.cells + 1));
        fractions.resize(3 * c.points);
        for (float& fraction : fractions) fraction = float(random() % 1025) / 1024;
        gradient = draw(c.points * SHOWN, 1);
        for (int l = 0; l < LAYERS; ++l) {
            const Layer size = layer(l);
            const float scale = (l == 0 ? c.frequency : 1) / std::sqrt(float(size.inputs));
            weights[l] = draw(std::size_t(size.outputs) * size.inputs, scale);
            biases[l] = draw(size.outputs, 1);
        }
    }

    Layer layer(int l) const {
        return {l == 0 ? of.channels : of.units, l == LAYERS - 1 ? SHOWN : of.units,
                weights[l].data(), biases[l].data()};
    }

    Decoder decoder() const {
        return {of.cells, of.channels, state.data(), {layer(0), layer(1), layer(2), layer(3)}};
    }

    Scattered source() const { return {rows.data(), fractions.data(), of.points}; }
};

template <class Real>
struct Results {
    std::vector<Real> seen, to_state, to_weights[LAYERS], to_biases[LAYERS];

    Results(const Problem& p, Real value)
        : seen(p.gradient.size(), value), to_state(p.state.size(), value) {
        for (int l = 0; l < LAYERS; ++l) {
            to_weights[l].assign(p.weights[l].size(), value);
            to_biases[l].assign(p.biases[l].size(), value);
        }
    }

    bool operator==(const Results&) const = default;
};

// ---- Decoding, as its equations have it ------------------------------------------------------

Results<double> exact(const Problem& p) {
    const Decoder d = p.decoder();
    const std::int64_t channels = d.channels;
    Results<double> result(p, 0);
    for (std::int64_t point = 0; point < p.of.points; ++point) {
        double shares[CORNERS];
        std::vector<double> inputs[LAYERS + 1], cosines[LAYERS];
        inputs[0].assign(channels, 0);
        for (int k = 0; k < CORNERS; ++k) {
            shares[k] = 1;
            for (int axis = 0; axis < 3; ++axis) {
                const double fraction = p.fractions[3 * point + axis];
                shares[k] *= k >> (2 - axis) & 1 ? fraction : 1 - fraction;
            }
            for (int c = 0; c < channels; ++c)
                inputs[0][c] +=
                    shares[k] * p.state[p.rows[k * p.of.points + point] * channels + c];
        }
        for (int l = 0; l < LAYERS; ++l)
            for (int o = 0; o < d.layers[l].outputs; ++o) {
                double sum = p.biases[l][o];
                for (int i = 0; i < d.layers[l].inputs; ++i)
                    sum += p.weights[l][o * d.layers[l].inputs + i] * inputs[l][i];
                inputs[l + 1].push_back(l < LAYERS - 1 ? std::sin(sum) : sum + inputs[0][o]);
                cosines[l].push_back(l < LAYERS - 1 ? std::cos(sum) : 1);
            }
        std::copy(inputs[LAYERS].begin(), inputs[LAYERS].end(), &result.seen[point * SHOWN]);

        std::vector<double> to(p.gradient.begin() + point * SHOWN,
                               p.gradient.begin() + (point + 1) * SHOWN);
        for (int l = LAYERS - 1; l >= 0; --l) {
            std::vector<double> to_inputs(d.layers[l].inputs, 0);
            for (int o = 0; o < d.layers[l].outputs; ++o) {
                const double to_sum = to[o] * cosines[l][o];
                result.to_biases[l][o] += to_sum;
                for (int i = 0; i < d.layers[l].inputs; ++i) {
                    result.to_weights[l][o * d.layers[l].inputs + i] += to_sum * inputs[l][i];
                    to_inputs[i] += to_sum * p.weights[l][o * d.layers[l].inputs + i];
                }
            }
            to = to_inputs;
        }
        for (int c = 0; c < SHOWN; ++c) to[c] += p.gradient[point * SHOWN + c];
        for (int k = 0; k < CORNERS; ++k)
            for (int c = 0; c < channels; ++c)
                result.to_state[p.rows[k * p.of.points + point] * channels + c] +=
                    shares[k] * to[c];
    }
    std::fill(result.to_state.end() - channels, result.to_state.end(), 0);
    return result;
}

// ---- Decoding under test ---------------------------------------------------------------------

// Forward and backward, into arrays of other content; false if either says so.
bool run(const DecodeKernel& kernel, const Problem& p, int threads, Results<float>& to) {
    to = Results<float>(p, 1e30f);
    const bool valid = decode(kernel, p.decoder(), p.source(), to.seen.data(), threads);
    DecodeGradients gradients;
    gradients.state = to.to_state.data();
    for (int l = 0; l < LAYERS; ++l) {
        gradients.weights[l] = to.to_weights[l].data();
        gradients.biases[l] = to.to_biases[l].data();
    }
    return decode_backward(kernel, p.decoder(), p.source(), p.gradient.data(), gradients,
                           threads) && valid;
}

Results<float> results(const DecodeKernel& kernel, const Problem& p, int threads) {
    Results<float> to(p, 0);
    expect(run(kernel, p, threads, to), std::string(p.of.name) + ": a right problem is refused");
    return to;
}

void test_agreement(const Problem& p) {
    const Results<double> right = exact(p);
    for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel) {
        const std::string where = std::string(p.of.name) + ", " + (*kernel)->name + ": ";
        const Results<float> got = results(**kernel, p, 1);
        const auto check = [&](const std::string& name, const auto& values, const auto& expected) {
            const double off = error(values, expected);
            expect(off <= 5e-6, where + name + " is off by " + std::to_string(off));
        };
        // Far out the sum itself is off by more than a period: only the bits are compared.
        if (p.of.frequency < 100) {
            check("what is seen", got.seen, right.seen);
            check("gradient of the state", got.to_state, right.to_state);
            for (int l = 0; l < LAYERS; ++l) {
                check("gradient of weights", got.to_weights[l], right.to_weights[l]);
                check("gradient of a bias", got.to_biases[l], right.to_biases[l]);
            }
        }
        for (const int threads : THREADS)
            expect(results(**kernel, p, threads) == got,
                   where + "other bits with " + std::to_string(threads) + " threads");
    }
}

void test_rows_out_of_range() {
    Problem p(CASES[2]);
    Results<float> ignored(p, 0);
    for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel)
        for (const std::int64_t row : {std::int64_t(-1), p.of.cells + 1, std::int64_t(INT32_MAX)})
            for (const int threads : THREADS) {
                std::int32_t& entry = p.rows[5 * p.of.points + 3000];
                const std::int32_t before = std::exchange(entry, std::int32_t(row));
                expect(!run(**kernel, p, threads, ignored), "a row out of range is accepted");
                entry = before;
            }
}

// What parts show are the means of what their points do, the same bits with any number of threads.
void test_means(const Decoder& decoder, const Subdivided& source, int samples) {
    const int along = source.along, parts = along / samples;
    const std::size_t count = source.chosen_cells * parts * parts * parts;
    std::vector<float> seen(source.count * SHOWN), colour(3 * count), change(count);
    for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel) {
        expect(decode(**kernel, decoder, source, seen.data(), 1), "cells are refused");
        std::vector<double> light(3 * count, 0), density(count, 0);
        for (std::int64_t i = 0; i < source.count; ++i) {
            const std::int64_t cell = i / source.each, z = i % along / samples;
            const std::int64_t x = i / along / along % along / samples, y = i / along % along / samples;
            const std::size_t at = ((cell * parts + x) * parts + y) * parts + z;
            const auto limited = [&](double v, double most) { return std::clamp(v, -most, most); };
            for (int c = 0; c < 3; ++c) {
                const double v = limited(seen[i * SHOWN + c], 0.5) + 0.5;
                light[3 * at + c] += v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
            }
            density[at] += limited(seen[i * SHOWN + 3], 0.25);
        }
        for (double& value : light) value /= samples * samples * samples;
        for (double& value : density) value /= samples * samples * samples;
        for (const int threads : THREADS) {
            std::vector<float> other(3 * count, 1e30f), changes(count, 1e30f);
            const Shown to = {samples, 0.25f, other.data(), changes.data()};
            expect(decode_parts(**kernel, decoder, source, to, threads), "cells are refused");
            if (threads == THREADS[0]) {
                colour = other;
                change = changes;
            }
            expect(other == colour && changes == change, "other bits with other threads");
        }
        expect(error(colour, light) <= 5e-6, "light is off");
        expect(error(change, density) <= 5e-6, "density is off");
    }
}

// The parts of cells are points like others: those of a table whose entries are all different.
void test_parts_of_cells() {
    const Problem p({"parts", 0, 40, 12, 8});
    std::vector<std::int32_t> neighbours(NEIGHBOURS * p.of.cells);
    for (std::size_t i = 0; i < neighbours.size(); ++i)
        neighbours[i] = std::int32_t(i * 7 % (p.of.cells + 1));
    std::vector<std::int32_t> cells = {39, 0, 7};
    for (int factor = 1; factor <= Subdivided::FINEST; ++factor) {
        const Subdivided parts(cells.data(), std::int64_t(cells.size()), neighbours.data(), factor);
        for (std::int64_t begin = 0; begin < parts.count; begin += BLOCK) {
            Points points;
            points.count = int(std::min<std::int64_t>(BLOCK, parts.count - begin));
            expect(parts.find(p.decoder(), begin, points), "right cells are refused");
            for (int i = 0; i < points.count; ++i) {
                double total = 0;
                for (int k = 0; k < CORNERS; ++k) total += points.shares[k][i];
                expect(std::abs(total - 1) < 1e-6, "shares do not add up to one");
            }
        }
        for (int samples = 1; samples <= factor; ++samples)
            if (factor % samples == 0) test_means(p.decoder(), parts, samples);
        std::vector<float> colour(cells.size() * 3), change(cells.size());
        const Shown whole = {factor, 0.5f, colour.data(), change.data()};
        for (const std::int32_t wrong : {-1, 40, INT32_MAX}) {
            const std::int32_t before = std::exchange(cells.back(), wrong);
            expect(!decode_parts(**decode_kernels(), p.decoder(), parts, whole, 2),
                   "a cell out of range is accepted");
            cells.back() = before;
        }
    }
}

void test_callers_at_the_same_time() {
    const Problem p(CASES[2]);
    expect_the_same_of_callers([&](int threads) { return results(**decode_kernels(), p, threads); });
}

}  // namespace

int main() {
    for (const Case& c : CASES) test_agreement(Problem(c));
    test_rows_out_of_range();
    test_parts_of_cells();
    test_callers_at_the_same_time();
    std::printf("native decoding holds with");
    for (const DecodeKernel* const* kernel = decode_kernels(); *kernel != nullptr; ++kernel)
        std::printf(" %s", (*kernel)->name);
    std::printf("\n");
}
