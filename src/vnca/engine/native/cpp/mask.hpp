// Which cells change in a step: the bits of mask.py.
#pragma once

#include <cstdint>

namespace vnca {

// A bijection of 32-bit integers (Wellons' lowbias32, 2018), or of vectors of them. Always inlined:
// inner loops that are compiled for several targets call it, too.
template <class Bits>
__attribute__((always_inline)) inline Bits mix(Bits value) {
    value ^= value >> 16;
    value *= 0x7FEB352Du;
    value ^= value >> 15;
    value *= 0x846CA68Bu;
    return value ^ (value >> 16);
}

// Which cells change in a step: those whose hash, mixed with the key of the step, lies below the
// threshold.
struct Mask {
    const std::int32_t* hashes;  // of all cells; null if all change
    std::uint32_t key, threshold;
};

// Writes the numbers of the cells that change, ascending, and returns how many there are. `rows`
// has room for all cells.
inline std::int64_t changing_rows(const Mask& mask, std::int64_t cells, std::int32_t* rows) {
    std::int64_t count = 0;
    for (std::int64_t cell = 0; cell < cells; ++cell) {
        // Written in any case: half of the cells change, and a branch would be guessed wrong.
        rows[count] = std::int32_t(cell);
        count += mix(std::uint32_t(mask.hashes[cell]) ^ mask.key) < mask.threshold;
    }
    return count;
}

}  // namespace vnca
