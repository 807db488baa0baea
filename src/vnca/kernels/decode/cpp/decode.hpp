// Decoding a state at points and its gradient, over all points and threads. Knows nothing of Python.
#pragma once

#include "decode_block.hpp"

namespace vnca {

// Kernels that this machine can run, fastest first, ended by a null.
const DecodeKernel* const* decode_kernels();

// Where points lie, block by block. `find` fills in corners and shares of the `count` points from
// `begin` on, and returns false if a row is out of range; what is dereferenced later is that copy.
struct PointSource {
    std::int64_t count;

    explicit PointSource(std::int64_t points) : count(points) {}
    virtual bool find(const Decoder&, std::int64_t begin, Points&) const = 0;

protected:
    ~PointSource() = default;
};

// Points anywhere: `rows` [CORNERS, count] of the cells around them, z fastest, and `fractions`
// [count, 3] of the way from the first of them to the last.
struct Scattered final : PointSource {
    const std::int32_t* rows;
    const float* fractions;

    Scattered(const std::int32_t* rows_of, const float* fractions_of, std::int64_t points)
        : PointSource(points), rows(rows_of), fractions(fractions_of) {}
    bool find(const Decoder&, std::int64_t begin, Points&) const override;
};

// The centres of the factor³ parts of each of some cells [chosen], cell by cell, z fastest;
// `neighbours` [27, cells] are the rows of the state around each cell.
struct Subdivided final : PointSource {
    static constexpr int FINEST = 8, PARTS = FINEST * FINEST * FINEST;
    const std::int32_t *chosen, *neighbours;
    int parts;
    std::int8_t offsets[PARTS][CORNERS];  // rows of `neighbours`
    float shares[PARTS][CORNERS];

    Subdivided(const std::int32_t* chosen_cells, std::int64_t cells,
               const std::int32_t* neighbours_of, int factor);
    bool find(const Decoder&, std::int64_t begin, Points&) const override;
};

// Gradients to be written, each of the shape of what it belongs to.
struct DecodeGradients {
    float *state, *weights[LAYERS], *biases[LAYERS];
};

// Both return false, leaving their output undefined, if a row is out of range; they never read or
// write through such an index. They throw where there is not enough memory.
bool decode(const DecodeKernel&, const Decoder&, const PointSource&, float* out, int threads);
bool decode_backward(const DecodeKernel&, const Decoder&, const PointSource&, const float* gradient,
                     const DecodeGradients&, int threads);

}  // namespace vnca
