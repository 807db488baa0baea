// The inner loops of a step over one block of cells. Compiled once for each instruction set, with
// VNCA_TARGET naming it; vectors are the compiler's own, as wide as the flags of the target allow.
//
// Everything here is local to the file, and no function of the standard library is called but
// memcpy: an inline function compiled for AVX-512 must never be the one that the linker keeps.

#include <cstring>

#include "block.hpp"

namespace vnca::VNCA_TARGET {
namespace {

#if defined(__AVX512F__)
constexpr int LANES = 16, REGISTERS = 32;
#elif defined(__AVX__)
constexpr int LANES = 8, REGISTERS = 16;
#elif defined(__aarch64__)
constexpr int LANES = 4, REGISTERS = 32;
#else
constexpr int LANES = 4, REGISTERS = 16;
#endif

typedef float Vec __attribute__((vector_size(LANES * sizeof(float))));

#define INLINE inline __attribute__((always_inline))

INLINE Vec load(const float* from) {
    Vec v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

INLINE void store(float* to, Vec v) { std::memcpy(to, &v, sizeof v); }

INLINE Vec splat(float x) { return x - Vec{}; }

constexpr std::size_t round_up(std::size_t x, std::size_t to) { return (x + to - 1) / to * to; }

// ---- Matrix products -------------------------------------------------------------------------

// A tile of Rows × Width vectors is summed in registers; WIDEST is the best for this target, and
// what is left over of a matrix's width is done by narrower, higher tiles.
constexpr int WIDEST = REGISTERS == 32 ? 4 : 2;
constexpr int height(int width) {
    if (REGISTERS == 16) return width == 2 ? 6 : 12;
    return width == 4 ? 6 : width == 3 ? 8 : 12;
}
constexpr int HEIGHTS = 24;  // a multiple of every height
static_assert(BLOCK % HEIGHTS == 0);
constexpr int PANEL = WIDEST * LANES;

// The left factor: element (i, k) is at i * row + k * step.
struct Left {
    const float* data;
    std::size_t row, step;
};

// The right factor in panels of PANEL columns: row k of panel p is at p * panel + k * step.
struct Right {
    const float* data;
    std::size_t panel, step;
};

// A matrix in rows taken as the right factor.
INLINE Right in_rows(const float* data, std::size_t stride) { return {data, PANEL, stride}; }

// A matrix that `pack_panels` wrote: each panel contiguous, so that its rows do not fight for the
// same lines of the cache.
INLINE Right in_panels(const float* data, int depth) {
    return {data, std::size_t(depth) * PANEL, PANEL};
}

template <int Rows, int Width, class Finish>
INLINE void tile(Left left, const float* right, std::size_t right_step, int depth,
                 const Finish& finish) {
    Vec sum[Rows][Width] = {};
    const float* a = left.data;
    for (int k = 0; k < depth; ++k) {
        Vec b[Width];
#pragma GCC unroll 4
        for (int j = 0; j < Width; ++j) b[j] = load(right + j * LANES);
#pragma GCC unroll 12
        for (int i = 0; i < Rows; ++i) {
            const Vec ai = splat(a[i * left.row]);
#pragma GCC unroll 4
            for (int j = 0; j < Width; ++j) sum[i][j] += ai * b[j];
        }
        a += left.step;
        right += right_step;
    }
#pragma GCC unroll 12
    for (int i = 0; i < Rows; ++i)
#pragma GCC unroll 4
        for (int j = 0; j < Width; ++j) finish(i, j * LANES, sum[i][j]);
}

template <int Width, class Finish>
INLINE void panel(int rows, int column, int depth, Left left, const float* right,
                  std::size_t right_step, const Finish& finish) {
    constexpr int Rows = height(Width);
    for (int row = 0; row < rows; row += Rows) {
        const Left from{left.data + row * left.row, left.row, left.step};
        tile<Rows, Width>(from, right, right_step, depth,
                          [&](int i, int j, Vec v) { finish(row + i, column + j, v); });
    }
}

// The product of left [rows, depth] and right [depth, columns], handed vector by vector to
// finish(row, column, sum). Rows are rounded up to a tile's height, columns are whole vectors:
// memory on both sides must allow that. A row's sums do not depend on the rows around it.
template <class Finish>
INLINE void multiply(int rows, int columns, int depth, Left left, Right right,
                     const Finish& finish) {
    int column = 0;
    const float* b = right.data;
    for (; column + PANEL <= columns; column += PANEL, b += right.panel)
        panel<WIDEST>(rows, column, depth, left, b, right.step, finish);
    switch ((columns - column) / LANES) {
        case 1: panel<1>(rows, column, depth, left, b, right.step, finish); break;
        case 2: if constexpr (WIDEST > 2) panel<2>(rows, column, depth, left, b, right.step, finish); break;
        case 3: if constexpr (WIDEST > 3) panel<3>(rows, column, depth, left, b, right.step, finish); break;
    }
}

constexpr std::size_t panels_size(std::size_t depth, std::size_t columns) {
    return depth * round_up(columns, PANEL);
}

// Writes value(k, column) for all of [depth, columns] in panels, zeros where they are padded.
template <class Value>
float* pack_panels(float* to, int depth, int columns, const Value& value) {
    for (int first = 0; first < columns; first += PANEL)
        for (int k = 0; k < depth; ++k)
            for (int j = first; j < first + PANEL; ++j) *to++ = j < columns ? value(k, j) : 0.0f;
    return to;
}

// ---- Where things lie ------------------------------------------------------------------------

struct Layout {
    int channels, inputs, filtered, hidden;  // inputs: perception, priors and a one for the bias
    std::size_t wide_channels, wide_filtered, wide_hidden;    // whole vectors
    std::size_t z_stride, hidden_stride, gradient_stride;     // of a cell in scratch
    std::int64_t safe_rows;  // rows of the state that can be read in whole vectors
    std::size_t tail_rows;

    // The packed weights, followed by the last rows of the state, each padded to whole vectors.
    std::size_t first, second, second_back, first_back, tail, packed;

    explicit Layout(const Step& s) {
        channels = s.channels;
        inputs = s.inputs() + 1;
        filtered = FILTERS * s.channels;
        hidden = s.hidden;
        wide_channels = round_up(channels, LANES);
        wide_filtered = round_up(filtered, LANES);
        wide_hidden = round_up(hidden, LANES);
        // A vector more than a power of two, so that rows start in different sets of the cache.
        z_stride = round_up(inputs, HEIGHTS) + LANES;
        hidden_stride = wide_hidden + LANES;
        gradient_stride = round_up(channels, HEIGHTS);
        safe_rows = s.cells + 2 - std::int64_t(round_up(wide_channels, channels) / channels);
        if (safe_rows < 0) safe_rows = 0;
        tail_rows = std::size_t(s.cells + 1 - safe_rows);

        first = 0;
        second = first + panels_size(inputs, hidden);
        second_back = second + panels_size(hidden, channels);
        first_back = second_back + panels_size(channels, hidden);
        tail = first_back + panels_size(hidden, filtered);
        packed = tail + tail_rows * wide_channels;
    }
};

Sizes sizes(const Step& s) {
    const Layout at(s);
    Sizes result;
    result.packed = at.packed;
    result.scratch = BLOCK * (at.z_stride + 2 * at.hidden_stride + at.gradient_stride +
                              at.wide_filtered + LANES);
    result.first_rows = round_up(at.inputs, HEIGHTS);
    result.second_rows = round_up(at.channels, HEIGHTS);
    result.hidden = at.wide_hidden;
    result.channels = at.wide_channels;
    return result;
}

// Weights are scaled so that perception may work with whole numbers, and the bias is one more
// column of W1, which a one in z meets.
void pack(const Step& s, float* packed) {
    const Layout at(s);
    const int inputs = s.inputs();
    const auto first = [&](int unit, int k) {
        const float w = s.first[std::size_t(unit) * inputs + k];
        return k < at.filtered ? w * s.scale[k / s.channels] : w;
    };
    const auto second = [&](int c, int unit) { return s.second[std::size_t(c) * s.hidden + unit]; };

    pack_panels(packed + at.first, at.inputs, at.hidden,
                [&](int k, int unit) { return k < inputs ? first(unit, k) : s.bias[unit]; });
    pack_panels(packed + at.second, at.hidden, at.channels,
                [&](int unit, int c) { return second(c, unit); });
    pack_panels(packed + at.second_back, at.channels, at.hidden, second);
    pack_panels(packed + at.first_back, at.hidden, at.filtered, first);
    for (std::size_t row = 0; row < at.tail_rows; ++row) {
        float* to = packed + at.tail + row * at.wide_channels;
        const float* from = s.state + (at.safe_rows + row) * s.channels;
        for (int c = 0; c < int(at.wide_channels); ++c) to[c] = c < s.channels ? from[c] : 0.0f;
    }
}

// ---- Perception ------------------------------------------------------------------------------

// The filters with whole-number weights, times 32 (Sobel) and 26 (Laplacian) with the usual
// divisors. A neighbourhood is nine lines along z; a line's contribution depends on its distance
// |x| + |y| from the centre line.
constexpr float SMOOTH[3] = {4, 2, 1};        // of the difference along z, in the Sobel filter
constexpr float ENDS[3] = {6, 3, 2};          // of a line's ends, in the Laplacian
constexpr float MIDDLE[3] = {-88, 6, 3};      // of a line's middle
constexpr int CENTRE = NEIGHBOURS / 2;

// z of one cell, from the states of a vector of its channels: at(o) for o in OFFSETS order.
template <class At>
INLINE void perceive(const At& at, float* z, int channels) {
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
    const Vec along_x = rise + fall + 2.0f * (smooth[2][1] - smooth[0][1]);
    const Vec along_y = rise - fall + 2.0f * (smooth[1][2] - smooth[1][0]);
    const Vec along_z = SMOOTH[0] * slope[0] + SMOOTH[1] * slope[1] + slope[2];
    Vec laplacian = MIDDLE[0] * middle[0];
#pragma GCC unroll 3
    for (int d = 0; d < 3; ++d) laplacian += ENDS[d] * ends[d];
    laplacian += MIDDLE[1] * middle[1] + MIDDLE[2] * middle[2];

    // In this order: a vector reaches into the filters after it, which are then written over it.
    store(z, middle[0]);
    store(z + channels, along_x);
    store(z + 2 * channels, along_y);
    store(z + 3 * channels, along_z);
    store(z + 4 * channels, laplacian);
}

// The transpose of `perceive`: adds to the gradient of the neighbours, add(o, vector).
template <class Add>
INLINE void spread(const float* z, int channels, const Add& add) {
    const Vec identity = load(z), along_x = load(z + channels), along_y = load(z + 2 * channels),
              along_z = load(z + 3 * channels), laplacian = load(z + 4 * channels);
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

// ---- One block -------------------------------------------------------------------------------

void perceive_block(const Step& s, const Layout& at, const float* packed, const Block& block,
                    float* z) {
    const float* const tail = packed + at.tail;
    for (int i = 0; i < block.count; ++i, z += at.z_stride) {
        // From the last vector of channels to the first, see the end of `perceive`.
        for (int c = int(at.wide_channels) - LANES; c >= 0; c -= LANES)
            perceive(
                [&](int o) {
                    const std::int64_t row = block.around[o][i];
                    const float* const from =
                        row < at.safe_rows ? s.state + row * at.channels
                                           : tail + (row - at.safe_rows) * at.wide_channels;
                    return load(from + c);
                },
                z + c, at.channels);
        float* const after = z + at.filtered;
        const float* const priors = s.prior_values + std::int64_t(block.rows[i]) * s.priors;
        for (int p = 0; p < s.priors; ++p) after[p] = priors[p];
        after[s.priors] = 1.0f;
    }
}

// The hidden layer of a block. Negative, not "not positive": a state gone wrong stays visible.
INLINE void hidden_block(const Layout& at, const float* packed, const Block& block, const float* z,
                         float* hidden) {
    multiply(block.count, int(at.wide_hidden), at.inputs, Left{z, at.z_stride, 1},
             in_panels(packed + at.first, at.inputs), [&](int i, int j, Vec v) {
                 store(hidden + i * at.hidden_stride + j, v < 0.0f ? Vec{} : v);
             });
}

void forward(const Step& s, const float* packed, const Block& block, float* scratch, float* out) {
    const Layout at(s);
    float* const z = scratch;
    float* const hidden = z + BLOCK * at.z_stride;
    float* const change = hidden + BLOCK * at.hidden_stride;

    perceive_block(s, at, packed, block, z);
    hidden_block(at, packed, block, z, hidden);
    multiply(block.count, int(at.wide_channels), at.hidden, Left{hidden, at.hidden_stride, 1},
             in_panels(packed + at.second, at.hidden), [&](int i, int j, Vec v) {
                 store(change + i * at.wide_channels + j, v);
             });
    for (int i = 0; i < block.count; ++i) {
        float* const to = out + std::int64_t(block.rows[i]) * at.channels;
        const float* const from = change + i * at.wide_channels;
        for (int c = 0; c < at.channels; ++c) to[c] += from[c];
    }
}

void backward(const Step& s, const float* packed, const Block& block, const float* gradient,
              float* scratch, float* weights, float* state) {
    const Layout at(s);
    float* const z = scratch;
    float* const hidden = z + BLOCK * at.z_stride;
    float* const to_hidden = hidden + BLOCK * at.hidden_stride;
    float* const to_change = to_hidden + BLOCK * at.hidden_stride;
    float* const to_z = to_change + BLOCK * at.gradient_stride;
    float* const to_first = weights;
    float* const to_second = weights + round_up(at.inputs, HEIGHTS) * at.wide_hidden;

    perceive_block(s, at, packed, block, z);
    hidden_block(at, packed, block, z, hidden);
    for (int i = 0; i < block.count; ++i)
        std::memcpy(to_change + i * at.gradient_stride,
                    gradient + std::int64_t(block.rows[i]) * at.channels,
                    at.channels * sizeof(float));

    multiply(block.count, int(at.wide_hidden), at.channels, Left{to_change, at.gradient_stride, 1},
             in_panels(packed + at.second_back, at.channels), [&](int i, int j, Vec v) {
                 const std::size_t to = i * at.hidden_stride + j;
                 store(to_hidden + to, load(hidden + to) <= 0.0f ? Vec{} : v);
             });
    multiply(at.channels, int(at.wide_hidden), block.count, Left{to_change, 1, at.gradient_stride},
             in_rows(hidden, at.hidden_stride), [&](int c, int j, Vec v) {
                 float* const to = to_second + c * at.wide_hidden + j;
                 store(to, load(to) + v);
             });
    multiply(at.inputs, int(at.wide_hidden), block.count, Left{z, 1, at.z_stride},
             in_rows(to_hidden, at.hidden_stride), [&](int k, int j, Vec v) {
                 float* const to = to_first + k * at.wide_hidden + j;
                 store(to, load(to) + v);
             });
    multiply(block.count, int(at.wide_filtered), at.hidden, Left{to_hidden, at.hidden_stride, 1},
             in_panels(packed + at.first_back, at.hidden), [&](int i, int j, Vec v) {
                 store(to_z + i * at.wide_filtered + j, v);
             });
    for (int i = 0; i < block.count; ++i)
        for (int c = 0; c < int(at.wide_channels); c += LANES)
            spread(to_z + i * at.wide_filtered + c, at.channels, [&](int o, Vec v) {
                float* const to = state + block.slots[o][i] * std::int64_t(at.wide_channels) + c;
                store(to, load(to) + v);
            });
}

#define TEXT(x) #x
#define NAME(x) TEXT(x)

}  // namespace

extern const Kernel kernel = {NAME(VNCA_TARGET), sizes, pack, forward, backward};

}  // namespace vnca::VNCA_TARGET
