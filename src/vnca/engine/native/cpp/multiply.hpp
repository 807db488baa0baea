// Products of matrices that fit into the cache. For the inner loops alone, like vector.hpp.
#pragma once

#include "block.hpp"
#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

// A tile of Rows × Width vectors is summed in registers; WIDEST is the best for this target, and
// what is left over of a matrix's width is done by narrower, higher tiles.
constexpr int WIDEST = REGISTERS == 32 ? 4 : 2;
constexpr int height(int width) {
    if (REGISTERS == 16) return width == 2 ? 6 : 12;
    return width == 4 ? 6 : width == 3 ? 8 : 12;
}
constexpr int HEIGHTS = 24;  // a multiple of every height
static_assert(BLOCK % HEIGHTS == 0);
constexpr int PANEL = WIDEST * LANES;

// The left factor: the unit (i, k) is at i * row + k * step.
struct Left {
    const Unit* data;
    std::size_t row, step;
};

// The right factor, the unit (k, j) of it at k * stride + j.
struct InRows {
    const Unit* data;
    std::size_t stride;

    INLINE const Unit* at(int column) const { return data + column; }
    INLINE std::size_t step(int) const { return stride; }
};

// The right factor as `pack_panels` wrote it: PANEL columns at a time, so that it is read in order.
struct InPanels {
    const Unit* data;
    std::size_t depth;  // in units

    INLINE const Unit* at(int column) const { return data + depth * column; }
    INLINE std::size_t step(int width) const { return width * LANES; }
};

template <int Rows, int Width, class Finish>
INLINE void tile(Left left, const Unit* right, std::size_t right_step, std::size_t depth,
                 const Finish& finish) {
    // Rows by threes: three can be addressed from one register and the stride, and there are not
    // enough registers for one a row.
    constexpr int Bases = (Rows + 2) / 3;
    Vec sum[Rows][Width] = {};
    const Unit* a[Bases];
#pragma GCC unroll 4
    for (int base = 0; base < Bases; ++base) a[base] = left.data + 3 * base * left.row;
    for (std::size_t k = 0; k < depth; ++k) {
        Units b[Width];
#pragma GCC unroll 4
        for (int j = 0; j < Width; ++j) b[j] = load_as<Units>(right + j * LANES);
#pragma GCC unroll 12
        for (int i = 0; i < Rows; ++i)
#pragma GCC unroll 4
            for (int j = 0; j < Width; ++j)
                sum[i][j] = multiply_add(a[i / 3][i % 3 * left.row], b[j], sum[i][j]);
#pragma GCC unroll 4
        for (int base = 0; base < Bases; ++base) a[base] += left.step;
        right += right_step;
    }
#pragma GCC unroll 12
    for (int i = 0; i < Rows; ++i)
#pragma GCC unroll 4
        for (int j = 0; j < Width; ++j) finish(i, j * LANES, sum[i][j]);
}

template <int Width, class Right, class Finish>
INLINE void panel(int rows, int column, std::size_t depth, Left left, Right right,
                  const Finish& finish) {
    constexpr int Rows = height(Width);
    for (int row = 0; row < rows; row += Rows) {
        const Left from{left.data + row * left.row, left.row, left.step};
        tile<Rows, Width>(from, right.at(column), right.step(Width), depth,
                          [&](int i, int j, Vec v) { finish(row + i, column + j, v); });
    }
}

// The product of left [rows, depth] and right [depth, columns], handed vector by vector to
// finish(row, column, sum). The depth is in units. Rows are rounded up to a tile's height, columns
// are whole vectors: memory on both sides must allow that. A row's sums do not depend on the rows
// around it.
template <class Right, class Finish>
INLINE void multiply(int rows, int columns, std::size_t depth, Left left, Right right,
                     const Finish& finish) {
    int column = 0;
    for (; column + PANEL <= columns; column += PANEL)
        panel<WIDEST>(rows, column, depth, left, right, finish);
    switch ((columns - column) / LANES) {
        case 1: panel<1>(rows, column, depth, left, right, finish); break;
        case 2: if constexpr (WIDEST > 2) panel<2>(rows, column, depth, left, right, finish); break;
        case 3: if constexpr (WIDEST > 3) panel<3>(rows, column, depth, left, right, finish); break;
    }
}

constexpr std::size_t panels_size(int depth, int columns) {
    return units(depth) * round_up(columns, LANES);
}

// Writes value(k, column) for all of [depth, columns] in panels, zeros where they are padded.
template <class Value>
void pack_panels(Unit* panels, int depth, int columns, const Value& value) {
    Number* to = reinterpret_cast<Number*>(panels);
    const int wide = int(round_up(columns, LANES));
    for (int first = 0; first < wide; first += PANEL)
        for (int k = 0; k < depth; k += DEPTH)
            for (int j = first; j < wide && j < first + PANEL; ++j)
                for (int d = k; d < k + DEPTH; ++d)
                    *to++ = number(d < depth && j < columns ? value(d, j) : 0.0f);
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
