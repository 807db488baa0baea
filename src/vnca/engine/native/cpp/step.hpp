// A step of the automaton and its gradient, over all cells and threads. Knows nothing of Python.
#pragma once

#include "block.hpp"

namespace vnca {

// Kernels that this machine can run, fastest first, ended by a null.
const Kernel* const* kernels();

// Rows [count], strictly ascending within [0, cells): the cells that change.
struct Rows {
    const std::int32_t* data;
    std::int64_t count;
};

// Gradients to be written, each of the shape of what it belongs to.
struct Gradients {
    float *state, *first, *bias, *second;
};

// All return false, leaving their output undefined, if a neighbour of one of the rows lies
// outside [0, cells], or a cell outside its brick; they never read or write through such an index. They throw where there is
// not enough memory.
bool forward(const Kernel&, const Step&, Rows, float* out, int threads);
// The same with the neighbours given by bricks, for the cells that a mask chooses.
bool forward(const Kernel&, const Step&, const Bricks&, const Mask&, float* out, int threads);
bool backward(const Kernel&, const Step&, Rows, const float* gradient, Gradients, int threads);

}  // namespace vnca
