// States carried along: each cell takes what was upstream of it, interpolated cubically.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "places.hpp"
#include "ranges.hpp"
#include "thread_pool.hpp"

namespace vnca {

// Rows of a state by the index coordinates of their cells, through a table of the bricks of 8³.
class RowsOfCells {
public:
    static constexpr int BRICK = PlacesOfBricks::CELLS;

    RowsOfCells(const std::int32_t* bricks, const std::int32_t* rows, std::int64_t count,
                std::int32_t outside)
        : places_(bricks, count), rows_(rows), outside_(outside) {}

    // The rows of the 8³ cells of a brick, z fastest; nothing where there is none.
    const std::int32_t* brick(const std::int32_t at[3]) const {
        const std::int64_t found = places_.find(at);
        return found < 0 ? nullptr : rows_ + BRICK * found;
    }

    std::int32_t row(const std::int32_t cell[3]) const {
        const std::int32_t at[3] = {cell[0] >> 3, cell[1] >> 3, cell[2] >> 3};
        const std::int32_t* const rows = brick(at);
        return rows ? rows[PlacesOfBricks::place(cell)] : outside_;
    }

    std::int32_t outside() const { return outside_; }

private:
    PlacesOfBricks places_;
    const std::int32_t* rows_;
    std::int32_t outside_;
};

// The shares of four cells along an axis for a place between the two in the middle.
// Reference: Catmull & Rom 1974.
struct Cubic {
    float at[4];

    static Cubic of(float t) {
        return {{((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2,
                 ((4 - 3 * t) * t + 1) * t / 2, (t - 1) * t * t / 2}};
    }

    // A cell that is not alive counts as the next that is.
    Cubic among(const bool alive[4]) const {
        const bool has_below = alive[0] && alive[1], has_above = alive[3] && alive[2];
        const float first = has_below ? at[1] : at[1] + at[0],
                    second = has_above ? at[2] : at[2] + at[3];
        return {{has_below ? at[0] : 0, !alive[1] ? 0 : alive[2] ? first : first + second,
                 !alive[2] ? 0 : alive[1] ? second : second + first, has_above ? at[3] : 0}};
    }
};

// A state [cells + 1, channels] and where its cells lie.
struct Carrying {
    const float* state;
    int channels;
    RowsOfCells rows;
    std::int32_t lower[3], upper[3];  // of the box; beyond it cells are repeated or wrapped
    bool circular;
    float least;  // share of the eight cells around that must be alive

    // What a cell has once the state has moved by `moved` cells, finite: `to` [channels].
    void carry(const std::int32_t cell[3], const float moved[3], float* to) const {
        std::int32_t around[3][4];
        float t[3];
        for (int axis = 0; axis < 3; ++axis) {
            const double place = nearer(double(cell[axis]) - double(moved[axis]), axis);
            const double first = std::floor(place);
            t[axis] = float(place - first);
            for (int i = 0; i < 4; ++i)
                around[axis][i] = bordered(std::int64_t(first) + i - 1, axis);
        }
        std::int32_t found[4][4][4];
        float shares[4][4][4];
        const bool all = gather(around, found);
        if (!all && alive_share(found, t) < least) {
            const std::int32_t row = rows.row(cell);
            std::copy_n(state + std::int64_t(row) * channels, channels, to);
        } else {
            share(found, t, all, shares);
            sum(found[0][0], shares[0][0], to);
        }
    }

private:
    // A place beyond the box brought so near that it counts as it did.
    double nearer(double place, int axis) const {
        const double low = lower[axis], size = double(upper[axis]) - low;
        // Of a very large number of rounds not even whole ones are left: clamped, as it has to be.
        if (circular)
            return std::clamp(place - size * std::floor((place - low) / size), low - 1, low + size);
        return std::clamp(place, low - 4, low + size + 4);
    }

    std::int32_t bordered(std::int64_t at, int axis) const {
        const std::int64_t low = lower[axis], high = std::int64_t(upper[axis]) - 1;
        if (at >= low && at <= high) return std::int32_t(at);
        if (!circular) return std::int32_t(std::clamp(at, low, high));
        const std::int64_t size = high - low + 1;
        return std::int32_t(low + ((at - low) % size + size) % size);
    }

    // The rows of 4³ cells, and whether all are alive.
    bool gather(const std::int32_t around[3][4], std::int32_t found[4][4][4]) const {
        // Bricks are looked up once, where the last of them along each axis is left.
        const std::int32_t* bricks[4][4][4];
        int number[3][4];
        for (int axis = 0; axis < 3; ++axis)
            for (int i = 0; i < 4; ++i)
                number[axis][i] =
                    i > 0 && around[axis][i] >> 3 == around[axis][i - 1] >> 3 ? number[axis][i - 1] : i;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j)
                for (int k = 0; k < 4; ++k) {
                    if (number[0][i] != i || number[1][j] != j || number[2][k] != k) continue;
                    const std::int32_t at[3] = {around[0][i] >> 3, around[1][j] >> 3, around[2][k] >> 3};
                    bricks[i][j][k] = rows.brick(at);
                }
        bool all = true;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j) {
                const std::int32_t line = (around[0][i] & 7) << 6 | (around[1][j] & 7) << 3;
                for (int k = 0; k < 4; ++k) {
                    const auto* const brick = bricks[number[0][i]][number[1][j]][number[2][k]];
                    const std::int32_t row = brick ? brick[line | (around[2][k] & 7)] : rows.outside();
                    found[i][j][k] = row;
                    all &= row != rows.outside();
                }
            }
        return all;
    }

    // How much of the eight cells around a place is alive.
    float alive_share(const std::int32_t found[4][4][4], const float t[3]) const {
        float total = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const int i = corner >> 2, j = corner >> 1 & 1, k = corner & 1;
            if (found[i + 1][j + 1][k + 1] != rows.outside())
                total += (i ? t[0] : 1 - t[0]) * (j ? t[1] : 1 - t[1]) * (k ? t[2] : 1 - t[2]);
        }
        return total;
    }

    void share(const std::int32_t found[4][4][4], const float t[3], bool all,
               float shares[4][4][4]) const {
        const Cubic x = Cubic::of(t[0]), y = Cubic::of(t[1]), z = Cubic::of(t[2]);
        if (all) return outer(shares, x, [&](int) { return y; }, [&](int, int) { return z; });
        Cubic along_z[4][4], along_y[4];
        bool planes[4];
        for (int i = 0; i < 4; ++i) {
            bool lines[4];
            for (int j = 0; j < 4; ++j) {
                bool alive[4];
                for (int k = 0; k < 4; ++k) alive[k] = found[i][j][k] != rows.outside();
                along_z[i][j] = z.among(alive);
                lines[j] = alive[1] || alive[2];
            }
            along_y[i] = y.among(lines);
            planes[i] = lines[1] || lines[2];
        }
        outer(shares, x.among(planes), [&](int i) { return along_y[i]; },
              [&](int i, int j) { return along_z[i][j]; });
    }

    template <class Y, class Z>
    static void outer(float shares[4][4][4], const Cubic& x, const Y& y, const Z& z) {
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j) {
                const Cubic line = z(i, j);
                const float along_y = y(i).at[j];
                for (int k = 0; k < 4; ++k) shares[i][j][k] = line.at[k] * along_y * x.at[i];
            }
    }

    // Rows by their shares: the outside is a row of zeros.
    void sum(const std::int32_t* found, const float* shares, float* to) const {
        typedef float Part __attribute__((vector_size(4 * sizeof(float))));
        int c = 0;
        for (; c + 4 <= channels; c += 4) {
            Part total = {};
            for (int i = 0; i < 64; ++i) {
                Part part;
                std::memcpy(&part, state + std::int64_t(found[i]) * channels + c, sizeof part);
                total += shares[i] * part;
            }
            std::memcpy(to + c, &total, sizeof total);
        }
        for (; c < channels; ++c) {
            to[c] = 0;
            for (int i = 0; i < 64; ++i)
                to[c] += shares[i] * state[std::int64_t(found[i]) * channels + c];
        }
    }
};

// The state of cells [count, 3], each moved by `moved` [count, 3]: `to` [count + 1, channels].
// False if a movement is not finite.
inline bool carry(const Carrying& carrying, const std::int32_t* cells, const float* moved,
                  std::int64_t count, float* to, int threads) {
    const Ranges ranges(count);
    std::atomic<bool> valid = true;
    ThreadPool::of_process().run(ranges.count, std::max(1, threads), [&](int range, int) {
        for (std::int64_t i = ranges.begin(range); i < ranges.end(range); ++i) {
            const float* const by = moved + 3 * i;
            if (std::isfinite(by[0]) && std::isfinite(by[1]) && std::isfinite(by[2]))
                carrying.carry(cells + 3 * i, by, to + i * carrying.channels);
            else
                valid = false;
        }
    });
    std::fill_n(to + count * carrying.channels, carrying.channels, 0.0f);
    return valid;
}

}  // namespace vnca
