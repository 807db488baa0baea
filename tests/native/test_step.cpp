// The native step without Python: held to a scalar one in double precision on odd shapes, to the
// same bits whatever the number of threads, and to what it promises where something is wrong. Made
// to be run under sanitizers (`make sanitize`): arrays are exactly as large as the step is told.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "checks.hpp"
#include "step.hpp"
#include "thread_pool.hpp"

using namespace vnca;

namespace {

// ---- Problems --------------------------------------------------------------------------------

struct Case {
    const char* name;
    int x, y, z;
    double alive, changing;  // shares of the cells
    int channels, hidden, priors;
    bool tangled = false;  // any cell may neighbour any other
    bool steered = false;
};

constexpr Case CASES[] = {
    {"one cell", 1, 1, 1, 1, 1, 5, 17, 0},
    {"odd", 7, 9, 11, 1, 0.5, 12, 128, 7},
    {"several ranges", 33, 8, 65, 1, 0.5, 12, 32, 7},
    {"no cell", 4, 4, 4, 0, 1, 12, 32, 7},
    {"scattered", 24, 25, 26, 0.1, 0.5, 5, 33, 3},
    {"no change", 6, 5, 4, 1, 0, 12, 32, 7},
    {"thin", 1, 1, 65, 1, 1, 1, 1, 1},
    {"wide", 5, 6, 7, 1, 1, 64, 512, 16},
    {"many channels", 9, 8, 7, 0.6, 0.5, 20, 100, 2},
    {"tangled", 16, 17, 18, 1, 0.5, 3, 9, 1, true},
    {"steered", 9, 10, 11, 0.8, 0.5, 12, 64, 4, false, true},
    {"steered, one channel", 5, 6, 13, 1, 1, 1, 17, 0, false, true},
};

struct Problem {
    Case of;
    std::int64_t cells = 0;
    std::vector<std::int32_t> neighbours, rows;
    std::vector<float> state, priors, first, bias, second, gradient, steering;

    explicit Problem(const Case& c) : of(c) {
        std::mt19937 random(7);
        std::uniform_real_distribution<double> share;
        std::normal_distribution<float> normal;
        std::vector<std::int32_t> row_at(std::size_t(c.x) * c.y * c.z, -1);
        for (std::int32_t& row : row_at)
            if (share(random) < c.alive) row = std::int32_t(cells++);
        for (std::int32_t& row : row_at)
            if (row < 0) row = std::int32_t(cells);

        // The border repeats cells; where no cell is active is the row behind the last.
        const auto at = [&](int x, int y, int z) -> std::int32_t& {
            return row_at[(std::clamp(x, 0, c.x - 1) * c.y + std::clamp(y, 0, c.y - 1)) * c.z +
                          std::clamp(z, 0, c.z - 1)];
        };
        neighbours.resize(NEIGHBOURS * cells);
        for (int x = 0; x < c.x; ++x)
            for (int y = 0; y < c.y; ++y)
                for (int z = 0; z < c.z; ++z)
                    if (const std::int64_t cell = at(x, y, z); cell < cells)
                        for (int o = 0; o < NEIGHBOURS; ++o)
                            neighbours[o * cells + cell] =
                                at(x + o / 9 - 1, y + o / 3 % 3 - 1, z + o % 3 - 1);
        if (c.tangled)
            for (std::int32_t& row : neighbours) row = std::int32_t(random() % (cells + 1));
        for (std::int64_t cell = 0; cell < cells; ++cell)
            if (share(random) < c.changing) rows.push_back(std::int32_t(cell));

        const auto draw = [&](std::size_t size, float scale) {
            std::vector<float> values(size);
            for (float& value : values) value = scale * normal(random);
            return values;
        };
        const int inputs = FILTERS * c.channels + c.priors;
        state = draw((cells + 1) * c.channels, 1);
        std::fill(state.end() - c.channels, state.end(), 0.0f);
        priors = draw(cells * c.priors, 1);
        first = draw(std::size_t(c.hidden) * inputs, 0.1f);
        bias = draw(c.hidden, 0.1f);
        second = draw(std::size_t(c.channels) * c.hidden, 0.1f);
        gradient = draw(state.size(), 1);
        if (c.steered) steering = draw(9 * std::size_t(cells), 1);
    }

    Step step() const {
        // Those that are steered have one divisor.
        const float y = of.steered ? 1 / 30.0f : 1 / 31.0f, z = of.steered ? y : 1 / 32.0f;
        return {cells, of.channels, of.hidden, of.priors, state.data(), neighbours.data(),
                priors.data(), first.data(), bias.data(), second.data(),
                {1.0f, 1 / 30.0f, y, z, 1 / 26.0f}, of.steered ? steering.data() : nullptr};
    }
};

template <class Real>
struct Results {
    std::vector<Real> state, to_state, to_first, to_bias, to_second;

    Results(const Problem& p, Real value)
        : state(p.state.size(), value),
          to_state(p.state.size(), value),
          to_first(p.first.size(), value),
          to_bias(p.bias.size(), value),
          to_second(p.second.size(), value) {}

    bool operator==(const Results&) const = default;
};

// ---- The step, as its equation has it --------------------------------------------------------

double weight(int filter, int o) {
    constexpr int SMOOTH[] = {1, 2, 1}, LAPLACIAN[] = {-88, 6, 3, 2};
    const int offset[] = {o / 9 - 1, o / 3 % 3 - 1, o % 3 - 1};
    const int distance = std::abs(offset[0]) + std::abs(offset[1]) + std::abs(offset[2]);
    if (filter == 0) return distance == 0;
    if (filter == 4) return LAPLACIAN[distance];
    int sobel = offset[filter - 1];
    for (int axis = 0; axis < 3; ++axis)
        if (axis != filter - 1) sobel *= SMOOTH[offset[axis] + 1];
    return sobel;
}

// Of a filter around a cell that is steered by F [3, 3]: gradients are turned by it.
double weight(int filter, int o, const float* steering) {
    if (steering == nullptr || filter == 0) return weight(filter, o);
    double sum = 0;
    if (filter == 4) {
        for (int i = 0; i < 9; ++i) sum += double(steering[i]) * steering[i];
        return sum / 3 * weight(4, o);
    }
    for (int j = 0; j < 3; ++j) sum += steering[3 * (filter - 1) + j] * weight(1 + j, o);
    return sum;
}

float to_bfloat16(float x) {
    std::uint32_t bits = std::bit_cast<std::uint32_t>(x);
    bits += 0x7fff + (bits >> 16 & 1);
    return std::bit_cast<float>(bits & 0xffff0000);
}

// With every factor of the products rounded to bfloat16, if asked for.
Results<double> exact(const Problem& p, bool bfloat16) {
    const Step s = p.step();
    const int inputs = s.inputs(), filtered = FILTERS * s.channels;
    const std::int64_t channels = s.channels;
    const auto factor = [&](double x) { return bfloat16 ? to_bfloat16(float(x)) : x; };
    const auto scale = [&](int k) { return k < filtered ? s.scale[k / s.channels] : 1.0; };
    std::vector<double> first(p.first.size()), second(p.second.size());
    for (std::size_t i = 0; i < first.size(); ++i)
        first[i] = factor(scale(int(i % inputs)) * p.first[i]);
    std::transform(p.second.begin(), p.second.end(), second.begin(), factor);

    Results<double> result(p, 0);
    std::copy(p.state.begin(), p.state.end(), result.state.begin());
    std::copy(p.gradient.begin(), p.gradient.end() - s.channels, result.to_state.begin());
    std::vector<double> z(inputs), to_z(inputs), gradient(s.channels);
    for (const std::int64_t row : p.rows) {
        const float* const steering = s.steering ? s.steering + 9 * row : nullptr;
        const auto each_weight = [&](const auto& visit) {
            for (int k = 0; k < filtered; ++k)
                for (int o = 0; o < NEIGHBOURS; ++o)
                    visit(k, s.neighbours[o * s.cells + row] * channels + k % channels,
                          weight(k / channels, o, steering));
        };
        std::fill(z.begin(), z.end(), 0);
        std::fill(to_z.begin(), to_z.end(), 0);
        each_weight([&](int k, std::int64_t from, double w) { z[k] += w * s.state[from]; });
        std::copy_n(s.prior_values + row * s.priors, s.priors, z.begin() + filtered);
        std::transform(z.begin(), z.end(), z.begin(), factor);
        std::transform(&p.gradient[row * s.channels], &p.gradient[(row + 1) * s.channels],
                       gradient.begin(), factor);

        for (int unit = 0; unit < s.hidden; ++unit) {
            double sum = s.bias[unit], to_sum = 0;
            for (int k = 0; k < inputs; ++k) sum += first[unit * inputs + k] * z[k];
            const double hidden = factor(sum);
            if (!(hidden > 0)) continue;
            for (int c = 0; c < s.channels; ++c) {
                result.state[row * s.channels + c] += second[c * s.hidden + unit] * hidden;
                result.to_second[c * s.hidden + unit] += gradient[c] * hidden;
                to_sum += second[c * s.hidden + unit] * gradient[c];
            }
            to_sum = factor(to_sum);
            result.to_bias[unit] += to_sum;
            for (int k = 0; k < inputs; ++k) {
                result.to_first[unit * inputs + k] += to_sum * z[k] * scale(k);
                to_z[k] += to_sum * first[unit * inputs + k];
            }
        }
        each_weight([&](int k, std::int64_t to, double w) { result.to_state[to] += w * to_z[k]; });
    }
    std::fill(result.to_state.end() - s.channels, result.to_state.end(), 0);
    return result;
}

// ---- The step under test ---------------------------------------------------------------------

// Forward and backward, into arrays of other content; false if either says so.
bool run(const Kernel& kernel, const Problem& p, int threads, Results<float>& to) {
    to = Results<float>(p, 1e30f);
    const Rows rows = {p.rows.data(), std::int64_t(p.rows.size())};
    const bool valid = forward(kernel, p.step(), rows, to.state.data(), threads);
    const Gradients gradients = {to.to_state.data(), to.to_first.data(), to.to_bias.data(),
                                 to.to_second.data()};
    return backward(kernel, p.step(), rows, p.gradient.data(), gradients, threads) && valid;
}

Results<float> results(const Kernel& kernel, const Problem& p, int threads) {
    Results<float> to(p, 0);
    expect(run(kernel, p, threads, to), std::string(p.of.name) + ": a right problem is refused");
    return to;
}

// Neighbours as bricks have them: each cell has one of its own.
struct InBricks {
    std::vector<std::int32_t> around, places, hashes;

    explicit InBricks(const Problem& p)
        : around(HALOED * p.cells), places(p.cells), hashes(p.cells, -1) {
        constexpr int MIDDLE = NEXT_X + NEXT_Y + 1;
        for (std::int64_t cell = 0; cell < p.cells; ++cell) {
            places[cell] = std::int32_t(HALOED * cell + MIDDLE);
            for (int o = 0; o < NEIGHBOURS; ++o)
                around[HALOED * cell + o / 9 * NEXT_X + o / 3 % 3 * NEXT_Y + o % 3] =
                    p.neighbours[o * p.cells + cell];
        }
        // With a key of 0, what mixes to 0 changes and what does not is chosen here.
        for (const std::int32_t row : p.rows) hashes[row] = 0;
    }

    Bricks bricks() const {
        return {std::int64_t(places.size()), around.data(), places.data()};
    }
    Mask mask() const { return {hashes.data(), 0, 1}; }
};

void test_bricks(const Problem& p) {
    InBricks in(p);
    for (const Kernel* const* kernel = kernels(); *kernel != nullptr; ++kernel) {
        const std::string where = std::string(p.of.name) + " in bricks, " + (*kernel)->name + ": ";
        const std::vector<float> right = results(**kernel, p, 1).state;
        for (const int threads : THREADS) {
            std::vector<float> got(p.state.size(), 1e30f);
            expect(forward(**kernel, p.step(), in.bricks(), in.mask(), got.data(), threads),
                   where + "a right problem is refused");
            expect(got == right, where + "other bits than with listed neighbours");
        }
        if (p.rows.empty()) continue;
        std::vector<float> ignored(p.state.size());
        const std::size_t cell = p.rows.back();
        for (std::int32_t* entry : {&in.around[HALOED * cell + 5], &in.places[cell]})
            for (const std::int32_t wrong : {-1, INT32_MAX}) {
                const std::int32_t before = std::exchange(*entry, wrong);
                expect(!forward(**kernel, p.step(), in.bricks(), in.mask(), ignored.data(), 2),
                       where + "what is out of range is accepted");
                *entry = before;
            }
    }
}

void test_agreement(const Problem& p) {
    const Results<double> in_float = exact(p, false), in_bfloat16 = exact(p, true);
    for (const Kernel* const* kernel = kernels(); *kernel != nullptr; ++kernel) {
        const std::string where = std::string(p.of.name) + ", " + (*kernel)->name + ": ";
        const Results<float> got = results(**kernel, p, 1);
        const Results<double>& right = (*kernel)->bfloat16 ? in_bfloat16 : in_float;
        const auto check = [&](const char* name, const auto& values, const auto& expected) {
            const double off = error(values, expected);
            const bool fits = off <= ((*kernel)->bfloat16 ? 1e-4 : 2e-6);  // a NaN does not
            expect(fits, where + name + " is off by " + std::to_string(off));
        };
        check("state", got.state, right.state);
        check("gradient of the state", got.to_state, right.to_state);
        check("gradient of W1", got.to_first, right.to_first);
        check("gradient of b1", got.to_bias, right.to_bias);
        check("gradient of W2", got.to_second, right.to_second);
        for (const int threads : THREADS)
            expect(results(**kernel, p, threads) == got,
                   where + "other bits with " + std::to_string(threads) + " threads");
    }
}

void test_neighbours_out_of_range() {
    Problem p(CASES[2]);
    Results<float> ignored(p, 0);
    for (const Kernel* const* kernel = kernels(); *kernel != nullptr; ++kernel)
        for (const std::int64_t row : {std::int64_t(-1), p.cells + 1, std::int64_t(INT32_MAX)})
            for (const int threads : THREADS) {
                std::int32_t& entry = p.neighbours[11 * p.cells + p.rows.back()];
                const std::int32_t before = std::exchange(entry, std::int32_t(row));
                expect(!run(**kernel, p, threads, ignored), "a neighbour out of range is accepted");
                entry = before;
            }
    std::int64_t still = 0;
    while (std::binary_search(p.rows.begin(), p.rows.end(), std::int32_t(still))) ++still;
    p.neighbours[still] = -1;
    expect(run(**kernels(), p, 2, ignored), "neighbours of a cell that does not change are read");
}

void test_callers_at_the_same_time() {
    const Problem p(CASES[2]);
    expect_the_same_of_callers([&](int threads) { return results(**kernels(), p, threads); });
}

void test_an_exception_reaches_the_caller() {
    ThreadPool& thread_pool = ThreadPool::of_process();
    for (const int threads : THREADS) {
        bool caught = false;
        try {
            thread_pool.run(100, threads, [](int task, int) {
                if (task == 40) throw std::runtime_error("task");
            });
        } catch (const std::runtime_error&) {
            caught = true;
        }
        expect(caught, "an exception of a task is lost");
        std::atomic<int> done = 0;
        thread_pool.run(100, threads, [&](int, int) { ++done; });
        expect(done == 100, "tasks are left out after an exception");
    }
}

}  // namespace

int main() {
    for (const Case& c : CASES) {
        test_agreement(Problem(c));
        test_bricks(Problem(c));
    }
    test_neighbours_out_of_range();
    test_callers_at_the_same_time();
    test_an_exception_reaches_the_caller();
    std::printf("the native step holds with");
    for (const Kernel* const* kernel = kernels(); *kernel != nullptr; ++kernel)
        std::printf(" %s", (*kernel)->name);
    std::printf("\n");
}
