// Native carrying, tracing back and filling without Python: held to what is known of them exactly (a
// cubic keeps a slope, a midpoint step keeps a uniform flow), to the same bits whatever the number of
// threads, and to what they promise where something is wrong. Made to be run under sanitizers
// (`make sanitize`): arrays are exactly as large as they are told.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "carry.hpp"
#include "checks.hpp"
#include "fill.hpp"
#include "trace.hpp"

using namespace vnca;

namespace {

constexpr float HUGE_MOVE = std::numeric_limits<float>::max();
constexpr float LEAST = 0.5f;

// ---- Cells in bricks -------------------------------------------------------------------------

// Cells of a box, a share of them, in the bricks that have any.
struct Cells {
    std::int32_t lower[3], upper[3];
    std::vector<std::int32_t> bricks, rows, cells;  // [bricks, 3], [bricks, 512], [count, 3]
    std::int32_t count = 0;

    Cells(const std::int32_t (&low)[3], const std::int32_t (&high)[3], double alive) {
        std::copy_n(low, 3, lower);
        std::copy_n(high, 3, upper);
        std::mt19937 random(7);
        std::uniform_real_distribution<double> share;
        std::int32_t brick[3], place[3];
        for (brick[0] = low[0] >> 3; brick[0] <= (high[0] - 1) >> 3; ++brick[0])
            for (brick[1] = low[1] >> 3; brick[1] <= (high[1] - 1) >> 3; ++brick[1])
                for (brick[2] = low[2] >> 3; brick[2] <= (high[2] - 1) >> 3; ++brick[2]) {
                    std::vector<std::int32_t> inside(RowsOfCells::BRICK, -1);
                    const std::int32_t before = count;
                    for (int flat = 0; flat < RowsOfCells::BRICK; ++flat) {
                        const int at[3] = {flat >> 6, flat >> 3 & 7, flat & 7};
                        bool is_inside = true;
                        for (int axis = 0; axis < 3; ++axis) {
                            place[axis] = 8 * brick[axis] + at[axis];
                            is_inside &= place[axis] >= low[axis] && place[axis] < high[axis];
                        }
                        if (!is_inside || share(random) >= alive) continue;
                        inside[flat] = count++;
                        cells.insert(cells.end(), place, place + 3);
                    }
                    if (count == before) continue;
                    bricks.insert(bricks.end(), brick, brick + 3);
                    rows.insert(rows.end(), inside.begin(), inside.end());
                }
        std::replace(rows.begin(), rows.end(), -1, count);
    }

    std::int64_t brick_count() const { return std::int64_t(bricks.size() / 3); }

    // [count + 1, channels]: each channel grows along the axes by its own slopes, behind is a zero.
    std::vector<float> slopes(int channels) const {
        std::vector<float> state;
        for (std::int32_t cell = 0; cell < count; ++cell)
            for (int c = 0; c < channels; ++c) state.push_back(slope(&cells[3 * cell], nullptr, c));
        state.resize(state.size() + channels, 0.0f);
        return state;
    }
    static float slope(const std::int32_t* cell, const float* moved, int channel) {
        double value = channel;
        for (int axis = 0; axis < 3; ++axis)
            value += ((channel + axis) % 3 - 1) * 0.25 * (cell[axis] - (moved ? moved[axis] : 0.0));
        return float(value);
    }

    Carrying carrying(const std::vector<float>& state, int channels, bool circular) const {
        Carrying of = {state.data(), channels, {bricks.data(), rows.data(), brick_count(), count},
                       {}, {}, circular, LEAST};
        std::copy_n(lower, 3, of.lower);
        std::copy_n(upper, 3, of.upper);
        return of;
    }

    Tracing tracing(const std::vector<float>& velocity) const {
        Tracing of = {{bricks.data(), brick_count()}, velocity.data(), {}, {}, LEAST};
        std::copy_n(lower, 3, of.lower);
        std::copy_n(upper, 3, of.upper);
        return of;
    }
};

const Cells& whole() {
    static const Cells cells({-5, 3, -9}, {14, 12, 11}, 1);
    return cells;
}
const Cells& scattered() {
    static const Cells cells({-5, 3, -9}, {14, 12, 11}, 0.4);
    return cells;
}

std::vector<float> random_moves(std::int32_t count, float most) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> move(-most, most);
    std::vector<float> moved(3 * std::size_t(count));
    for (float& by : moved) by = move(random);
    return moved;
}

// ---- Carrying --------------------------------------------------------------------------------

std::vector<float> carried(const Cells& from, const std::vector<float>& state, int channels,
                           bool circular, const std::vector<float>& moved, int threads) {
    std::vector<float> to(state.size(), 1e30f);
    expect(carry(from.carrying(state, channels, circular), from.cells.data(), moved.data(), from.count,
                 to.data(), threads),
           "a right movement is refused");
    return to;
}

void test_a_slope_is_carried_exactly(int channels) {
    const Cells& cells = whole();
    const std::vector<float> state = cells.slopes(channels), moved = random_moves(cells.count, 2);
    const std::vector<float> to = carried(cells, state, channels, false, moved, 1);
    for (std::int32_t cell = 0; cell < cells.count; ++cell) {
        bool is_inside = true;  // as far as the cells are that a cubic looks at
        for (int axis = 0; axis < 3; ++axis) {
            const float place = float(cells.cells[3 * cell + axis]) - moved[3 * cell + axis];
            is_inside &= place > cells.lower[axis] + 1 && place < cells.upper[axis] - 3;
        }
        for (int c = 0; is_inside && c < channels; ++c) {
            const float right = Cells::slope(&cells.cells[3 * cell], &moved[3 * cell], c);
            expect(std::abs(to[std::size_t(cell) * channels + c] - right) < 1e-4f * (1 + channels),
                   "a slope is bent by carrying");
        }
    }
    for (const int threads : THREADS)
        expect(carried(cells, state, channels, false, moved, threads) == to,
               "carrying: other bits with " + std::to_string(threads) + " threads");
    expect(carried(cells, state, channels, false, random_moves(cells.count, 0), 2) == state,
           "what does not move is changed");
}

void test_what_is_the_same_everywhere_stays_so() {
    for (const Cells* const cells : {&whole(), &scattered()})
        for (const bool circular : {false, true})
            for (const float most : {0.7f, 3.0f, 300.0f, 3e9f, 1e20f, 1e38f, HUGE_MOVE}) {
                std::vector<float> state(3 * std::size_t(cells->count) + 3, 1.5f);
                std::fill(state.end() - 3, state.end(), 0.0f);
                const std::vector<float> moved =
                    most == HUGE_MOVE ? std::vector<float>(3 * std::size_t(cells->count), HUGE_MOVE)
                                      : random_moves(cells->count, most);
                const std::vector<float> to = carried(*cells, state, 3, circular, moved, 2);
                for (std::size_t i = 0; i < to.size(); ++i)
                    expect(std::abs(to[i] - state[i]) < 1e-5f,
                           "what is the same everywhere is changed by movements of " +
                               std::to_string(most));
            }
}

void test_a_ring_is_closed() {
    const Cells& cells = whole();
    const std::vector<float> state = cells.slopes(5);
    std::vector<float> moved(3 * std::size_t(cells.count));
    for (std::size_t i = 0; i < moved.size(); ++i)
        moved[i] = float(4 * (cells.upper[i % 3] - cells.lower[i % 3]));
    expect(carried(cells, state, 5, true, moved, 2) == state, "four times around is not where it was");
}

void test_movements_that_are_not_finite() {
    const Cells& cells = whole();
    const std::vector<float> state = cells.slopes(4);
    std::vector<float> moved = random_moves(cells.count, 1), ignored(state.size());
    for (const float wrong : {std::numeric_limits<float>::infinity(), std::nanf("")})
        for (const int threads : THREADS) {
            const float before = std::exchange(moved.back(), wrong);
            expect(!carry(cells.carrying(state, 4, false), cells.cells.data(), moved.data(), cells.count,
                          ignored.data(), threads),
                   "a movement that is not finite is accepted");
            moved.back() = before;
        }
}

// ---- Tracing back ----------------------------------------------------------------------------

std::vector<float> traced(const Cells& of, const std::vector<float>& velocity,
                          const std::vector<float>& times, int threads) {
    std::vector<float> moved(3 * std::size_t(of.count), 1e30f);
    trace(of.tracing(velocity), of.cells.data(), times.data(), times.size() == 1 ? 0 : 1, of.count,
          moved.data(), threads);
    return moved;
}

void test_a_uniform_flow_is_traced_exactly() {
    constexpr float FLOW[3] = {1.25f, -0.5f, 3.0f};
    for (const Cells* const cells : {&whole(), &scattered()}) {
        std::vector<float> velocity(3 * cells->rows.size(), 0.0f);
        for (std::size_t i = 0; i < cells->rows.size(); ++i)
            if (cells->rows[i] < cells->count) std::copy_n(FLOW, 3, &velocity[3 * i]);
        std::vector<float> times(cells->count);
        for (std::int32_t cell = 0; cell < cells->count; ++cell) times[cell] = float(cell % 5) - 2;
        const std::vector<float> right = traced(*cells, velocity, times, 1);
        for (std::int32_t cell = 0; cell < cells->count; ++cell)
            for (int axis = 0; axis < 3; ++axis)
                expect(std::abs(right[3 * cell + axis] - times[cell] * FLOW[axis]) < 1e-5f,
                       "a uniform flow is not traced back");
        for (const int threads : THREADS)
            expect(traced(*cells, velocity, times, threads) == right,
                   "tracing: other bits with " + std::to_string(threads) + " threads");
    }
}

void test_any_velocity_is_survived() {
    const Cells& cells = scattered();
    for (const float wild : {HUGE_MOVE, std::numeric_limits<float>::infinity(), std::nanf("")}) {
        const std::vector<float> velocity(3 * cells.rows.size(), wild);
        for (const float time : {-1.0f, 1.0f, HUGE_MOVE})
            expect(traced(cells, velocity, {time}, 2).size() == 3 * std::size_t(cells.count), "length");
    }
    const Cells nothing({0, 0, 0}, {1, 1, 1}, 0);
    expect(traced(nothing, {}, {1.0f}, 2).empty(), "no cell moves");
}

// ---- Filling ---------------------------------------------------------------------------------

// Two bricks, one above the other along z, of which one cell is known.
struct Unfilled {
    static constexpr std::int64_t BRICKS = 2, PLACES = (BRICKS + 1) * Filling::BRICK;
    std::vector<float> values = std::vector<float>(3 * PLACES, 0.0f);
    std::vector<std::uint8_t> known = std::vector<std::uint8_t>(PLACES, 0);
    std::vector<std::int64_t> beside =
        std::vector<std::int64_t>(Filling::WAYS * BRICKS, BRICKS * Filling::BRICK);

    Unfilled() {
        beside[4 * BRICKS + 1] = 0;               // down along z from the upper one
        beside[5 * BRICKS + 0] = Filling::BRICK;  // and up from the lower one
        known[0] = 1;
        values[0] = 2, values[1] = -3, values[2] = 5;
    }
    Filling filling() { return {BRICKS, values.data(), known.data(), beside.data()}; }

    std::vector<std::int64_t> front() {
        std::vector<std::int64_t> found;
        for (std::int64_t cell = 0; cell < BRICKS * Filling::BRICK; ++cell) {
            bool is_met = false;
            for (int way = 0; way < Filling::WAYS && !known[cell]; ++way)
                is_met |= known[filling().next(cell, way)] != 0;
            if (is_met) found.push_back(cell);
        }
        return found;
    }
};

void test_all_is_filled_from_one_cell() {
    for (const int threads : THREADS) {
        Unfilled of;
        int layers = 0;
        for (auto front = of.front(); !front.empty(); front = of.front(), ++layers) {
            expect(fill(of.filling(), front.data(), std::int64_t(front.size()), threads),
                   "right cells are refused");
            for (const std::int64_t cell : front) of.known[cell] = 1;
        }
        expect(layers == 7 + 7 + 15, "layers are skipped");
        for (std::int64_t cell = 0; cell < of.BRICKS * Filling::BRICK; ++cell)
            expect(std::equal(&of.values[3 * cell], &of.values[3 * cell] + 3, of.values.data()),
                   "one value is not continued as it is");
    }
}

void test_what_is_out_of_range_is_not_filled() {
    for (const std::int64_t wrong : {std::int64_t(-1), std::int64_t(0), Unfilled::PLACES, INT64_MAX}) {
        Unfilled of;
        expect(!fill(of.filling(), &wrong, 1, 2), "a cell out of range, or known, is filled");
    }
    for (const std::int64_t wrong : {std::int64_t(-1), Unfilled::PLACES, INT64_MAX, INT64_MIN}) {
        Unfilled of;
        const std::int64_t corner = 1;
        of.beside[0] = wrong;  // down along x from the lower one
        expect(!fill(of.filling(), &corner, 1, 2), "a brick out of range is accepted");
    }
}

}  // namespace

int main() {
    for (const int channels : {1, 3, 4, 12, 13}) test_a_slope_is_carried_exactly(channels);
    test_what_is_the_same_everywhere_stays_so();
    test_a_ring_is_closed();
    test_movements_that_are_not_finite();
    test_a_uniform_flow_is_traced_exactly();
    test_any_velocity_is_survived();
    test_all_is_filled_from_one_cell();
    test_what_is_out_of_range_is_not_filled();
    std::printf("native carrying, tracing and filling hold\n");
}
