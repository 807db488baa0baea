// Which cells change in a step: the bits of mask.py.
#pragma once

#include <cstdint>

namespace vnca {

// A bijection of 32-bit integers (Wellons' lowbias32, 2018).
inline std::uint32_t mix(std::uint32_t value) {
    value ^= value >> 16;
    value *= 0x7FEB352Du;
    value ^= value >> 15;
    value *= 0x846CA68Bu;
    return value ^ (value >> 16);
}

// Writes the numbers of the cells that change, ascending, and returns how many there are. `rows`
// has room for all cells.
inline std::int64_t changing_rows(const std::int32_t* hashes, std::int64_t cells,
                                  std::uint32_t key, std::uint32_t threshold,
                                  std::int32_t* rows) {
    std::int64_t count = 0;
    for (std::int64_t cell = 0; cell < cells; ++cell) {
        // Written in any case: half of the cells change, and a branch would be guessed wrong.
        rows[count] = std::int32_t(cell);
        count += mix(std::uint32_t(hashes[cell]) ^ key) < threshold;
    }
    return count;
}

}  // namespace vnca
