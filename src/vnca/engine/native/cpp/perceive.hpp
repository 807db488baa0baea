// The five filters around a cell, and their transpose. For block.cpp alone, like vector.hpp.
#pragma once

#include "block.hpp"
#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

// The filters with whole-number weights, times 32 (Sobel) and 26 (Laplacian) with the usual
// divisors. A neighbourhood is nine lines along z; a line's contribution depends on its distance
// |x| + |y| from the centre line.
constexpr float SMOOTH[3] = {4, 2, 1};        // of the difference along z, in the Sobel filter
constexpr float ENDS[3] = {6, 3, 2};          // of a line's ends, in the Laplacian
constexpr float MIDDLE[3] = {-88, 6, 3};      // of a line's middle
constexpr int CENTRE = NEIGHBOURS / 2;

// How a cell is steered: F, by which its gradients are multiplied, and |F|² / 3, by which its
// Laplacian is.
struct Steering {
    float matrix[3][3];
    float laplacian;

    explicit Steering(const float* from) : laplacian(0) {
        std::memcpy(matrix, from, sizeof matrix);
        for (int i = 0; i < 9; ++i) laplacian += from[i] * from[i];
        laplacian /= 3.0f;
    }
    INLINE Vec along(int i, Vec x, Vec y, Vec z) const {
        return matrix[i][0] * x + matrix[i][1] * y + matrix[i][2] * z;
    }
    INLINE Vec back(int j, Vec x, Vec y, Vec z) const {
        return matrix[0][j] * x + matrix[1][j] * y + matrix[2][j] * z;
    }
};

// z of one cell, from the states of a vector of its channels: at(o) for o in OFFSETS order.
template <class At>
INLINE void perceive(const At& at, const Steering* steering, Number* z, int channels) {
    Vec smooth[3][3], ends[3] = {}, middle[3] = {}, slope[3] = {};
#pragma GCC unroll 3
    for (int x = 0; x < 3; ++x)
#pragma GCC unroll 3
        for (int y = 0; y < 3; ++y) {
            const int distance = (x != 1) + (y != 1);
            const Vec below = at(9 * x + 3 * y), here = at(9 * x + 3 * y + 1),
                      above = at(9 * x + 3 * y + 2);
            const Vec both = below + above;
            ends[distance] += both;
            middle[distance] += here;
            slope[distance] += above - below;
            smooth[x][y] = both + 2.0f * here;
        }
    const Vec rise = smooth[2][2] - smooth[0][0], fall = smooth[2][0] - smooth[0][2];
    Vec along_x = rise + fall + 2.0f * (smooth[2][1] - smooth[0][1]);
    Vec along_y = rise - fall + 2.0f * (smooth[1][2] - smooth[1][0]);
    Vec along_z = SMOOTH[0] * slope[0] + SMOOTH[1] * slope[1] + slope[2];
    Vec laplacian = MIDDLE[0] * middle[0];
#pragma GCC unroll 3
    for (int d = 0; d < 3; ++d) laplacian += ENDS[d] * ends[d];
    laplacian += MIDDLE[1] * middle[1] + MIDDLE[2] * middle[2];
    if (steering != nullptr) {
        const Vec x = along_x, y = along_y, z = along_z;
        along_x = steering->along(0, x, y, z);
        along_y = steering->along(1, x, y, z);
        along_z = steering->along(2, x, y, z);
        laplacian = steering->laplacian * laplacian;
    }

    // In this order: a vector reaches into the filters after it, which are then written over it.
    put(z, middle[0]);
    put(z + channels, along_x);
    put(z + 2 * channels, along_y);
    put(z + 3 * channels, along_z);
    put(z + 4 * channels, laplacian);
}

// The transpose of `perceive`: adds to the gradient of the neighbours, add(o, vector).
template <class Add>
INLINE void spread(const float* z, const Steering* steering, int channels, const Add& add) {
    const Vec identity = load(z);
    Vec along_x = load(z + channels), along_y = load(z + 2 * channels),
        along_z = load(z + 3 * channels), laplacian = load(z + 4 * channels);
    if (steering != nullptr) {
        const Vec x = along_x, y = along_y, z = along_z;
        along_x = steering->back(0, x, y, z);
        along_y = steering->back(1, x, y, z);
        along_z = steering->back(2, x, y, z);
        laplacian = steering->laplacian * laplacian;
    }
    const Vec rise = along_x + along_y, fall = along_x - along_y;
    const Vec smooth[3][3] = {{-rise, -2.0f * along_x, -fall},
                              {-2.0f * along_y, Vec{}, 2.0f * along_y},
                              {fall, 2.0f * along_x, rise}};
#pragma GCC unroll 3
    for (int x = 0; x < 3; ++x)
#pragma GCC unroll 3
        for (int y = 0; y < 3; ++y) {
            const int distance = (x != 1) + (y != 1), line = 9 * x + 3 * y;
            const Vec both = smooth[x][y] + ENDS[distance] * laplacian;
            const Vec slope = SMOOTH[distance] * along_z;
            Vec here = 2.0f * smooth[x][y] + MIDDLE[distance] * laplacian;
            if (line + 1 == CENTRE) here += identity;
            add(line, both - slope);
            add(line + 1, here);
            add(line + 2, both + slope);
        }
}

}  // namespace
}  // namespace vnca::VNCA_TARGET
