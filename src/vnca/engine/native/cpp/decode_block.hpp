// What the vectorised inner loops of decoding offer to the driver, whatever instructions they use.
#pragma once

#include <cstddef>
#include <cstdint>

#include "block.hpp"

namespace vnca {

constexpr int CORNERS = 8;  // of the cube of cells around a point
constexpr int SHOWN = 4;    // colour and Δd
constexpr int LAYERS = 4;   // three of sines, and the output

struct Layer {
    int inputs, outputs;
    const float *weights, *bias;  // [outputs, inputs], [outputs]
};

// A state and the network that is applied between its cells, C-contiguous and checked.
struct Decoder {
    std::int64_t cells;
    int channels;
    const float* state;  // [cells + 1, channels], the last row is the outside
    Layer layers[LAYERS];
};

// Where the points of one block lie.
struct Points {
    int count;                             // at most BLOCK
    std::int32_t corners[CORNERS][BLOCK];  // rows of the state, each in [0, cells]
    float shares[CORNERS][BLOCK];          // what each corner counts
    std::int32_t slots[CORNERS][BLOCK];    // backward: rows of the gathered gradient
};

// How many floats the buffers take, and how the gradients of the weights are laid out.
struct DecodeSizes {
    std::size_t packed;    // weights as the inner loops want them, shared by all threads
    std::size_t scratch;   // one thread's working memory
    std::size_t channels;  // padded width of the gradient of a cell's state
    std::size_t gradient;  // of all layers
    std::size_t begin[LAYERS], width[LAYERS];  // of [weights | bias]ᵀ of a layer in it, its stride
};

struct DecodeKernel {
    const char* name;
    DecodeSizes (*sizes)(const Decoder&);
    void (*pack)(const Decoder&, float* packed);

    // out [count, SHOWN] = what is seen at the points.
    void (*forward)(const Decoder&, const float* packed, const Points&, float* scratch, float* out);

    // Makes of what is seen at points, whole vectors of it, linear light and Δd from −most to most.
    void (*light)(float* seen, int points, float most);

    // Makes of the gradient of that the gradient of what is seen, which is as it was before.
    void (*light_backward)(const float* seen, float* gradient, int points, float most);

    // Adds to `weights` the gradients of each layer's [weights | bias]ᵀ, and to `state` (rows given
    // by the slots) that of the cells around the points.
    void (*backward)(const Decoder&, const float* packed, const Points&, const float* gradient,
                     float* scratch, float* weights, float* state);
};

// One for each instruction set that this build knows, fastest first.
namespace avx512 { extern const DecodeKernel decode_kernel; }
namespace avx2 { extern const DecodeKernel decode_kernel; }
namespace portable { extern const DecodeKernel decode_kernel; }

}  // namespace vnca
