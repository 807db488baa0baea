// The cells of one brick: which of them change, and the states in and around it. For block.cpp
// alone, like vector.hpp.
#pragma once

#include "block.hpp"
#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

typedef std::uint32_t Bits __attribute__((vector_size(LANES * sizeof(std::uint32_t))));
constexpr int MOST_CHOSEN = BRICK + LANES;

// Writes the numbers of the cells in [begin, end) that change, ascending, and returns how many there
// are. There are at most BRICK cells; `numbers` has room for MOST_CHOSEN.
INLINE int choose(const Mask& mask, std::int64_t begin, std::int64_t end, std::int32_t* numbers) {
    int count = 0;
    std::int64_t cell = begin;
    for (; mask.hashes != nullptr && cell + LANES <= end; cell += LANES) {
        const Bits mixed = mix(load_as<Bits>(mask.hashes + cell) ^ mask.key);
        const auto changes = mixed < Bits{} + mask.threshold;  // all bits set, or none
        // Written in any case: half of the cells change, and a branch would be guessed wrong.
        for (int lane = 0; lane < LANES; ++lane) {
            numbers[count] = std::int32_t(cell + lane);
            count -= int(changes[lane]);
        }
    }
    for (; cell < end; ++cell) {
        numbers[count] = std::int32_t(cell);
        count += mask.hashes == nullptr ||
                 mix(std::uint32_t(mask.hashes[cell]) ^ mask.key) < mask.threshold;
    }
    return count;
}

// The state of a row in whole vectors: the last rows, behind which memory may end, are in `tail`.
struct States {
    const float *state, *tail;
    std::int64_t safe_rows;
    std::size_t channels, wide_channels;

    INLINE const float* at(std::int64_t row) const {
        return row < safe_rows ? state + row * channels : tail + (row - safe_rows) * wide_channels;
    }
};

// Copies the states in and around a brick, `around` being their rows, to [vector][place][lane]. False
// if a row is not in [0, cells].
INLINE bool gather(const States& states, std::int64_t cells, const std::int32_t* around,
                   float* brick) {
    bool valid = true;
    for (int place = 0; place < HALOED; ++place) {
        std::int64_t row = around[place];
        if (std::uint64_t(row) > std::uint64_t(cells)) {
            valid = false;
            row = cells;
        }
        const float* const from = states.at(row);
        for (std::size_t c = 0; c < states.wide_channels; c += LANES)
            store(brick + c * HALOED + place * LANES, load(from + c));
    }
    return valid;
}

// Brings a part of the states in and around a brick closer while another is worked on.
INLINE void fetch(const States& states, const std::int32_t* around, int begin, int end) {
    for (int place = begin; place < end && place < HALOED; ++place)
        __builtin_prefetch(states.state + around[place] * std::int64_t(states.channels));
}

// How far from a cell its neighbours are, in places, in the order of OFFSETS.
INLINE constexpr int step_to(int o) {
    return (o / 9 - 1) * NEXT_X + (o / 3 % 3 - 1) * NEXT_Y + o % 3 - 1;
}
constexpr int FARTHEST = NEXT_X + NEXT_Y + 1;

}  // namespace
}  // namespace vnca::VNCA_TARGET
