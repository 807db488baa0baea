// What the vectorised inner loops offer to the driver, whatever instructions they use.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mask.hpp"

namespace vnca {

constexpr int NEIGHBOURS = 27;
constexpr int FILTERS = 5;
constexpr int BLOCK = 48;  // cells worked through at a time; a multiple of every tile's height

// The arrays of one step, as the Python side hands them over: C-contiguous and checked.
struct Step {
    std::int64_t cells;
    int channels, hidden, priors;
    const float* state;              // [cells + 1, channels], the last row is the outside
    const std::int32_t* neighbours;  // [27, cells]
    const float* prior_values;       // [cells, priors]
    const float* first;              // W1 [hidden, 5 channels + priors]
    const float* bias;               // b1 [hidden]
    const float* second;             // W2 [channels, hidden]
    float scale[FILTERS];            // of each filter over its integer form, see `perceive`
    const float* steering = nullptr;  // [cells, 3, 3] of those that are steered, else null

    int inputs() const { return FILTERS * channels + priors; }
};

// Where the cells of a step lie: in bricks of 8³, each with a layer of the cells around it.
constexpr int HALO_EDGE = 10, HALOED = HALO_EDGE * HALO_EDGE * HALO_EDGE, BRICK = 512;
constexpr int NEXT_X = HALO_EDGE * HALO_EDGE, NEXT_Y = HALO_EDGE;
struct Bricks {
    std::int64_t count;
    const std::int32_t* around;  // [count, HALOED] rows of the state
    const std::int32_t* places;  // [cells] where each cell lies in `around`, laid out flat
};

// Cells of one block and where their neighbours are.
struct Block {
    int count;                                  // at most BLOCK
    const std::int32_t* rows;                   // [count]
    std::int32_t around[NEIGHBOURS][BLOCK];     // rows of the state, each in [0, cells]
    std::int32_t slots[NEIGHBOURS][BLOCK];      // backward: rows of the gathered gradient
};

// How many floats the buffers of a step take, and how their rows are laid out.
struct Sizes {
    std::size_t packed;         // weights as the inner loops want them, shared by all threads
    std::size_t scratch;        // one thread's working memory
    std::size_t brick;          // and what it takes more for bricks
    std::size_t first_rows;     // of the gradient of [W1 | b1]ᵀ, padded
    std::size_t second_rows;    // of the gradient of W2, padded
    std::size_t hidden;         // padded width of both
    std::size_t channels;       // padded width of the gradient of a cell's state

    std::size_t gradient() const { return (first_rows + second_rows) * hidden; }
};

struct Kernel {
    const char* name;
    bool bfloat16;  // what products multiply, else float; all else is float
    Sizes (*sizes)(const Step&);
    void (*pack)(const Step&, float* packed);

    // out[row] += the change of the row's cell.
    void (*forward)(const Step&, const float* packed, const Block&, float* scratch, float* out);

    // Writes the rows of the cells [begin, end) to `out`, changed where the mask says so. False if something of the bricks is out of range: nothing is
    // read or written through it.
    bool (*forward_bricks)(const Step&, const float* packed, const Bricks&, const Mask&,
                           std::int64_t begin, std::int64_t end, float* scratch, float* out);

    // Adds to `weights` the gradients of [W1 | b1]ᵀ and W2, and to `state` (rows given by the
    // block's slots) that of the cells' neighbourhoods.
    void (*backward)(const Step&, const float* packed, const Block&, const float* gradient,
                     float* scratch, float* weights, float* state);

    // Nothing but multiply-adds of what is in registers; returns how many operations these were,
    // two for each: what there is to be had.
    double (*multiply_adds)(std::int64_t rounds);
};

// One for each instruction set that this build knows, fastest first.
namespace amxbf16 { extern const Kernel kernel; }
namespace avx512bf16 { extern const Kernel kernel; }
namespace avx512 { extern const Kernel kernel; }
namespace avx2 { extern const Kernel kernel; }
namespace portable { extern const Kernel kernel; }

}  // namespace vnca
