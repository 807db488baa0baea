// Products on the processor's tiles (Intel AMX): 16 rows of 16 units by 16 units of 16 columns in one
// instruction. For multiply.hpp alone, where bfloat16 is multiplied so.
#pragma once

#include <immintrin.h>

#include "multiply.hpp"

namespace vnca::VNCA_TARGET {
namespace {

constexpr int TILE = 16;  // rows of a tile, and units or floats in one

// What the eight tiles hold: 0 to 2 the sums of 16 rows each; 3 and 7, in turns, the left factor, and 4
// the right one; 5 and 6 their last units, so that nothing is read beyond. The instructions take the
// numbers as they are written.
constexpr int LAST_LEFT = 5, LAST_RIGHT = 6;

class TilesInUse {
public:
    explicit TilesInUse(std::size_t last) {
        Configuration to;
        for (int each = 0; each < 8; ++each) to.rows[each] = TILE, to.bytes[each] = 4 * TILE;
        if (last > 0) {
            to.bytes[LAST_LEFT] = std::uint16_t(4 * last);
            to.rows[LAST_RIGHT] = std::uint8_t(last);
        }
        __asm__ volatile("ldtilecfg %0" ::"m"(to));  // GCC's own function names 8 of its bytes
    }
    ~TilesInUse() { _tile_release(); }

private:
    struct Configuration {
        std::uint8_t palette = 1, first_row = 0, none[14] = {};
        std::uint16_t bytes[16] = {};
        std::uint8_t rows[16] = {};
    };
};

// As the product of multiply.hpp, of at most three tiles' rows, whose units follow one another.
template <class Finish>
INLINE void multiply(int rows, int columns, std::size_t depth, Left left, InPanels right,
                     const Finish& finish) {
    static_assert(BLOCK <= 3 * TILE && LANES == TILE);
    const std::size_t last = depth % TILE, whole = depth - last, left_bytes = 4 * left.row;
    const TilesInUse tiles(last);
    __asm__ volatile("" ::: "memory");  // the compiler does not know that tiles read what was written
    alignas(64) float sums[3 * TILE * TILE];
    const Unit* const a[3] = {left.data, left.data + TILE * left.row, left.data + 2 * TILE * left.row};
    for (int column = 0; column < columns; column += TILE) {
        const int panel = column / PANEL * PANEL;
        const std::size_t width = panel + PANEL <= columns ? PANEL : columns - panel;
        const Unit* const b = right.at(panel) + (column - panel);
        _tile_zero(0);
        _tile_zero(1);
        _tile_zero(2);
        for (std::size_t k = 0; k < whole; k += TILE) {
            _tile_loadd(4, b + k * width, 4 * width);
            _tile_loadd(3, a[0] + k, left_bytes);
            _tile_dpbf16ps(0, 3, 4);
            if (rows > TILE) {
                _tile_loadd(7, a[1] + k, left_bytes);
                _tile_dpbf16ps(1, 7, 4);
            }
            if (rows > 2 * TILE) {
                _tile_loadd(3, a[2] + k, left_bytes);
                _tile_dpbf16ps(2, 3, 4);
            }
        }
        if (last > 0) {
            _tile_loadd(6, b + whole * width, 4 * width);
            _tile_loadd(5, a[0] + whole, left_bytes);
            _tile_dpbf16ps(0, 5, 6);
            if (rows > TILE) {
                _tile_loadd(5, a[1] + whole, left_bytes);
                _tile_dpbf16ps(1, 5, 6);
            }
            if (rows > 2 * TILE) {
                _tile_loadd(5, a[2] + whole, left_bytes);
                _tile_dpbf16ps(2, 5, 6);
            }
        }
        _tile_stored(0, sums, 4 * TILE);
        _tile_stored(1, sums + TILE * TILE, 4 * TILE);
        _tile_stored(2, sums + 2 * TILE * TILE, 4 * TILE);
        for (int row = 0; row < rows; ++row) finish(row, column, load(sums + row * TILE));
    }
}

// Nothing but products of tiles; returns how many operations these were.
inline double tile_multiply_adds(std::int64_t rounds) {
    const TilesInUse tiles(0);
    _tile_zero(0);
    _tile_zero(1);
    _tile_zero(2);
    _tile_zero(3);
    _tile_zero(4);
    _tile_zero(5);
    _tile_zero(6);
    _tile_zero(7);
    for (std::int64_t round = 0; round < rounds; ++round) {
        _tile_dpbf16ps(0, 6, 7);
        _tile_dpbf16ps(1, 6, 7);
        _tile_dpbf16ps(2, 6, 7);
        _tile_dpbf16ps(3, 6, 7);
        _tile_dpbf16ps(4, 6, 7);
        _tile_dpbf16ps(5, 6, 7);
    }
    return 2.0 * double(rounds) * 6 * TILE * TILE * TILE * DEPTH;
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
