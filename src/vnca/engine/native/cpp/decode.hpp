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

// Points in some cells [chosen], cell by cell, `along`³ in each, z fastest: the centres of its parts
// if it is cut into so many. `neighbours` [27, cells] are the rows of the state around each cell.
struct Subdivided final : PointSource {
    static constexpr int FINEST = 8, MOST = FINEST * FINEST * FINEST;
    const std::int32_t *chosen, *neighbours;
    std::int64_t chosen_cells;
    int along, each;                     // points along and in a cell
    std::int8_t offsets[MOST][CORNERS];  // rows of `neighbours`
    float shares[MOST][CORNERS];

    Subdivided(const std::int32_t* cells, std::int64_t count_of_cells,
               const std::int32_t* neighbours_of, int points_along);
    bool find(const Decoder&, std::int64_t begin, Points&) const override;
};

// Gradients to be written, each of the shape of what it belongs to.
struct DecodeGradients {
    float *state, *weights[LAYERS], *biases[LAYERS];
};

// What the parts of cells show, `samples`³ points in each: means of linear light and of Δd from −most
// to most, to `colour` [chosen, parts, 3] and `change` [chosen, parts].
struct Shown {
    int samples;
    float most;
    float *colour, *change;
};

// Of what is seen at points [points, SHOWN]: linear light [points, 3] and 1 + Δd [points], Δd from −most
// to most; and the gradient of what is seen from those of the two.
void show(const DecodeKernel&, const float* seen, std::int64_t points, float most, float* colour,
          float* factor, int threads);
void show_backward(const DecodeKernel&, const float* seen, std::int64_t points, float most,
                   const float* of_colour, const float* of_factor, float* gradient, int threads);

// All return false, leaving their output undefined, if a row is out of range; they never read or
// write through such an index. They throw where there is not enough memory.
bool decode(const DecodeKernel&, const Decoder&, const PointSource&, float* out, int threads);
bool decode_parts(const DecodeKernel&, const Decoder&, const Subdivided&, const Shown&, int threads);
bool decode_backward(const DecodeKernel&, const Decoder&, const PointSource&, const float* gradient,
                     const DecodeGradients&, int threads);

}  // namespace vnca
