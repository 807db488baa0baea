// Where bricks of 8³ cells lie.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

namespace vnca {

// Finds bricks by their coordinates, through a table.
class PlacesOfBricks {
public:
    static constexpr int CELLS = 512;

    // For bricks [count, 3], each once.
    PlacesOfBricks(const std::int32_t* bricks, std::int64_t count) : bricks_(bricks) {
        while (std::int64_t(table_.size()) < 2 * count) table_.resize(2 * table_.size(), NONE);
        for (std::int64_t brick = 0; brick < count; ++brick) {
            std::size_t slot = slot_of(bricks + 3 * brick);
            while (table_[slot] != NONE) slot = (slot + 1) & (table_.size() - 1);
            table_[slot] = std::int32_t(brick);
        }
    }

    // The number of a brick; -1 where there is none.
    std::int64_t find(const std::int32_t at[3]) const {
        for (std::size_t slot = slot_of(at);; slot = (slot + 1) & (table_.size() - 1)) {
            const std::int32_t found = table_[slot];
            if (found == NONE || std::memcmp(bricks_ + 3 * std::int64_t(found), at,
                                             3 * sizeof *at) == 0)
                return found;
        }
    }

    // The number of a cell in its brick, z fastest.
    static int place(const std::int32_t cell[3]) {
        return (cell[0] & 7) << 6 | (cell[1] & 7) << 3 | (cell[2] & 7);
    }

private:
    static constexpr std::int32_t NONE = -1;

    std::size_t slot_of(const std::int32_t at[3]) const {
        std::uint64_t hash = 0;
        for (int axis = 0; axis < 3; ++axis)
            hash = (hash ^ std::uint32_t(at[axis])) * 0x9e3779b97f4a7c15u;
        return (hash >> 32) & (table_.size() - 1);
    }

    const std::int32_t* bricks_;
    std::vector<std::int32_t> table_ = std::vector<std::int32_t>(16, NONE);
};

}  // namespace vnca
