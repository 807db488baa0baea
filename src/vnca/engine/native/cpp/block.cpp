// The work of a step on one block of cells, see vector.hpp for how it is compiled.

#include "block.hpp"

#include "brick.hpp"
#include "multiply.hpp"
#include "perceive.hpp"
#if defined(VNCA_TILES)
#include "tiles.hpp"
#endif
#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

// ---- Where things lie ------------------------------------------------------------------------

struct Layout {
    int channels, inputs, filtered, hidden;  // inputs: perception and priors
    std::size_t wide_channels, wide_filtered, wide_hidden;  // whole vectors
    std::size_t first_rows, second_rows;     // of the gradients of the weights, whole tiles
    std::size_t z_stride, hidden_stride, change_stride;     // of a cell in scratch, in units
    std::int64_t safe_rows;  // rows of the state that can be read in whole vectors
    std::size_t tail_rows;

    // The packed weights, followed by the last rows of the state, each padded to whole vectors.
    std::size_t first, bias, second, second_back, first_back, tail, packed;

    explicit Layout(const Step& s) {
        channels = s.channels;
        inputs = s.inputs();
        filtered = FILTERS * s.channels;
        hidden = s.hidden;
        wide_channels = round_up(channels, LANES);
        wide_filtered = round_up(filtered, LANES);
        wide_hidden = round_up(hidden, LANES);
        first_rows = round_up(inputs + 1, HEIGHTS);
        second_rows = round_up(channels, HEIGHTS);
        // Perception writes whole vectors, and so do priors.
        const std::size_t perceived = (FILTERS - 1) * channels + wide_channels,
                          told = filtered + round_up(s.priors + 1, LANES),
                          reach = perceived > told ? perceived : told;
        z_stride = stride_of(first_rows > reach ? first_rows : reach);
        hidden_stride = stride_of(wide_hidden);
        change_stride = stride_of(second_rows > wide_channels ? second_rows : wide_channels);
        safe_rows = s.cells + 2 - std::int64_t(round_up(wide_channels, channels) / channels);
        if (safe_rows < 0) safe_rows = 0;
        tail_rows = std::size_t(s.cells + 1 - safe_rows);

        first = 0;
        bias = first + panels_size(inputs, hidden);
        second = bias + wide_hidden;
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
    const std::size_t matrices = at.z_stride + 2 * at.hidden_stride + at.change_stride;
    result.scratch = BLOCK * ((DEPTH > 1 ? 2 : 1) * matrices + at.wide_filtered + LANES);
    result.brick = HALOED * at.wide_channels;
    result.first_rows = at.first_rows;
    result.second_rows = at.second_rows;
    result.hidden = at.wide_hidden;
    result.channels = at.wide_channels;
    return result;
}

// Weights are scaled so that perception may work with whole numbers.
void pack(const Step& s, float* packed) {
    const Layout at(s);
    const auto first = [&](int unit, int k) {
        const float w = s.first[std::size_t(unit) * at.inputs + k];
        return k < at.filtered ? w * s.scale[k / s.channels] : w;
    };
    const auto second = [&](int c, int unit) { return s.second[std::size_t(c) * s.hidden + unit]; };
    const auto panels = [&](std::size_t from) { return reinterpret_cast<Unit*>(packed + from); };

    pack_panels(panels(at.first), at.inputs, at.hidden,
                [&](int k, int unit) { return first(unit, k); });
    for (int unit = 0; unit < int(at.wide_hidden); ++unit)
        packed[at.bias + unit] = unit < s.hidden ? s.bias[unit] : 0.0f;
    pack_panels(panels(at.second), at.hidden, at.channels,
                [&](int unit, int c) { return second(c, unit); });
    pack_panels(panels(at.second_back), at.channels, at.hidden, second);
    pack_panels(panels(at.first_back), at.hidden, at.filtered, first);
    for (std::size_t row = 0; row < at.tail_rows; ++row) {
        float* to = packed + at.tail + row * at.wide_channels;
        const float* from = s.state + (at.safe_rows + row) * s.channels;
        for (int c = 0; c < int(at.wide_channels); ++c) to[c] = c < s.channels ? from[c] : 0.0f;
    }
}

// ---- One block -------------------------------------------------------------------------------

// Numbers of a block's cells, a row each.
struct Matrix {
    Unit* data;
    std::size_t stride;  // in units

    INLINE Number* row(int cell) const { return reinterpret_cast<Number*>(data + cell * stride); }
    INLINE Left left() const { return {data, stride, 1}; }
};

// The same as units across the cells.
struct Across {
    const Unit* data;
    std::size_t stride;

    INLINE Left transposed() const { return {data, 1, stride}; }
    INLINE InRows rows() const { return {data, stride}; }
};

// One thread's working memory, cut into pieces.
class Scratch {
public:
    explicit Scratch(float* memory) : next_(memory) {}

    float* floats(std::size_t width) {
        float* const piece = next_;
        next_ += BLOCK * width;
        return piece;
    }
    Matrix matrix(std::size_t stride) { return {reinterpret_cast<Unit*>(floats(stride)), stride}; }

    Across across(const Matrix& rows, const Block& block, std::size_t width) {
        Unit* const room = DEPTH > 1 ? matrix(rows.stride).data : nullptr;
        return {interleave(rows.data, rows.stride, block.count, int(width), room),
                DEPTH * rows.stride};
    }

private:
    float* next_;
};

// The packed weights as right factors.
struct Weights {
    InPanels first, second, second_back, first_back;
    const float *bias, *tail;

    Weights(const Layout& at, const float* packed)
        : first(panels(packed + at.first, at.inputs)),
          second(panels(packed + at.second, at.hidden)),
          second_back(panels(packed + at.second_back, at.channels)),
          first_back(panels(packed + at.first_back, at.hidden)),
          bias(packed + at.bias),
          tail(packed + at.tail) {}

    static InPanels panels(const float* data, int depth) {
        return {reinterpret_cast<const Unit*>(data), units(depth)};
    }
};

// z of one cell, from what is around it: at(o), in the order of OFFSETS, gives the first of its
// channels, a vector of which is `apart` floats from the next.
template <class At>
INLINE void perceive_cell(const Layout& layout, const At& at, std::size_t apart,
                          const Steering* steering, Number* z) {
    // From the last vector of channels to the first, see the end of `perceive`.
    for (int v = int(layout.wide_channels) / LANES; v-- > 0;)
        perceive([&](int o) { return load(at(o) + v * apart); }, steering, z + v * LANES,
                 layout.channels);
}

// Calls use(steering) with how a cell is steered, null if it is not.
template <class Use>
INLINE void steered(const Step& s, std::int64_t row, const Use& use) {
    if (s.steering == nullptr) return use(nullptr);
    const Steering steering(s.steering + 9 * row);
    use(&steering);
}

// Priors of one cell, and a one, which the gradient of the bias meets.
INLINE void append_priors(const Step& s, std::int64_t row, Number* to) {
    const float* const priors = s.prior_values + row * s.priors;
    if ((row + 1) * s.priors + LANES <= s.cells * s.priors)
        for (int p = 0; p < s.priors; p += LANES) put(to + p, load(priors + p));
    else
        for (int p = 0; p < s.priors; ++p) to[p] = number(priors[p]);
    to[s.priors] = number(1.0f);
}

States states_of(const Step& s, const Layout& at, const Weights& weights) {
    return {s.state, weights.tail, at.safe_rows, std::size_t(at.channels), at.wide_channels};
}

void perceive_block(const Step& s, const Layout& at, const Weights& weights, const Block& block,
                    Matrix z) {
    const States states = states_of(s, at, weights);
    for (int i = 0; i < block.count; ++i) {
        steered(s, block.rows[i], [&](const Steering* steering) {
            perceive_cell(at, [&](int o) { return states.at(block.around[o][i]); }, LANES, steering,
                          z.row(i));
        });
        append_priors(s, block.rows[i], z.row(i) + at.filtered);
    }
}

// The hidden layer of some cells. Negative, not "not positive": a state gone wrong stays visible.
INLINE void hidden_block(const Layout& at, const Weights& weights, int count, Matrix z,
                         Matrix hidden) {
    multiply(count, int(at.wide_hidden), units(at.inputs), z.left(), weights.first,
             [&](int i, int j, Vec v) {
                 v += load(weights.bias + j);
                 put(hidden.row(i) + j, v < 0.0f ? Vec{} : v);
             });
}

// Adds the change of some cells, given z, to their rows of the state.
INLINE void add_change(const Layout& at, const Weights& weights, const std::int32_t* rows, int count,
                       Matrix z, Matrix hidden, float* out) {
    hidden_block(at, weights, count, z, hidden);
    multiply(count, int(at.wide_channels), units(at.hidden), hidden.left(), weights.second,
             [&](int i, int j, Vec v) {
                 if (i < count)
                     add_first(out + std::int64_t(rows[i]) * at.channels + j, v, at.channels - j);
             });
}

void forward(const Step& s, const float* packed, const Block& block, float* memory, float* out) {
    const Layout at(s);
    const Weights weights(at, packed);
    Scratch scratch(memory);
    const Matrix z = scratch.matrix(at.z_stride), hidden = scratch.matrix(at.hidden_stride);
    perceive_block(s, at, weights, block, z);
    add_change(at, weights, block.rows, block.count, z, hidden, out);
}

bool forward_bricks(const Step& s, const float* packed, const Bricks& bricks, const Mask& mask,
                    std::int64_t begin, std::int64_t end, float* memory, float* out) {
    const Layout at(s);
    const Weights weights(at, packed);
    const States states = states_of(s, at, weights);
    Scratch scratch(memory);
    const Matrix z = scratch.matrix(at.z_stride), hidden = scratch.matrix(at.hidden_stride);
    float* const around = memory + sizes(s).scratch;
    std::int32_t rows[BLOCK], chosen[MOST_CHOSEN];
    int waiting = 0;  // cells whose z is there, of whatever bricks
    for (std::int64_t first = begin, last; first < end; first = last) {
        const std::int64_t brick = bricks.places[first] / HALOED, lowest = brick * HALOED;
        if (bricks.places[first] < 0 || brick >= bricks.count) return false;
        const std::int64_t furthest = first + BRICK < end ? first + BRICK : end;
        for (last = first + 1; last < furthest; ++last)
            if (std::uint64_t(bricks.places[last] - lowest) >= HALOED) break;
        std::memcpy(out + first * at.channels, s.state + first * at.channels,
                    std::size_t(last - first) * at.channels * sizeof(float));
        const int count = choose(mask, first, last, chosen);
        if (count == 0) continue;
        const std::int32_t* const next = bricks.around + (lowest + HALOED) % (bricks.count * HALOED);
        const int portion = HALOED / count + 1;
        if (!gather(states, s.cells, bricks.around + lowest, around)) return false;
        for (int i = 0; i < count; ++i) {
            const std::int64_t row = chosen[i], place = bricks.places[row] - lowest;
            if (place < FARTHEST || place >= HALOED - FARTHEST) return false;
            const float* const here = around + place * LANES;
            steered(s, row, [&](const Steering* steering) {
                perceive_cell(at, [&](int o) { return here + step_to(o) * LANES; }, HALOED * LANES,
                              steering, z.row(waiting));
            });
            append_priors(s, row, z.row(waiting) + at.filtered);
            fetch(states, next, i * portion, (i + 1) * portion);
            rows[waiting++] = std::int32_t(row);
            if (waiting == BLOCK) {
                add_change(at, weights, rows, BLOCK, z, hidden, out);
                waiting = 0;
            }
        }
    }
    add_change(at, weights, rows, waiting, z, hidden, out);
    return true;
}

void backward(const Step& s, const float* packed, const Block& block, const float* gradient,
              float* memory, float* to_weights, float* state) {
    const Layout at(s);
    const Weights weights(at, packed);
    Scratch scratch(memory);
    const Matrix z = scratch.matrix(at.z_stride), hidden = scratch.matrix(at.hidden_stride),
                 to_hidden = scratch.matrix(at.hidden_stride),
                 to_change = scratch.matrix(at.change_stride);
    float* const to_z = scratch.floats(at.wide_filtered);
    float* const to_first = to_weights;
    float* const to_second = to_weights + at.first_rows * at.wide_hidden;
    const auto add_to = [&](float* gradient) {
        return [=, width = at.wide_hidden](int row, int j, Vec v) {
            float* const to = gradient + row * width + j;
            store(to, load(to) + v);
        };
    };

    perceive_block(s, at, weights, block, z);
    hidden_block(at, weights, block.count, z, hidden);
    for (int i = 0; i < block.count; ++i) {
        const float* const from = gradient + std::int64_t(block.rows[i]) * at.channels;
        for (int c = 0; c < at.channels; ++c) to_change.row(i)[c] = number(from[c]);
    }
    multiply(block.count, int(at.wide_hidden), units(at.channels), to_change.left(),
             weights.second_back, [&](int i, int j, Vec v) {
                 put(to_hidden.row(i) + j, get(hidden.row(i) + j) <= 0.0f ? Vec{} : v);
             });

    multiply(at.channels, int(at.wide_hidden), units(block.count),
             scratch.across(to_change, block, at.second_rows).transposed(),
             scratch.across(hidden, block, at.wide_hidden).rows(), add_to(to_second));
    multiply(at.inputs + 1, int(at.wide_hidden), units(block.count),
             scratch.across(z, block, at.first_rows).transposed(),
             scratch.across(to_hidden, block, at.wide_hidden).rows(), add_to(to_first));
    multiply(block.count, int(at.wide_filtered), units(at.hidden), to_hidden.left(),
             weights.first_back,
             [&](int i, int j, Vec v) { store(to_z + i * at.wide_filtered + j, v); });
    for (int i = 0; i < block.count; ++i)
        steered(s, block.rows[i], [&](const Steering* steering) {
            for (int c = 0; c < int(at.wide_channels); c += LANES)
                spread(to_z + i * at.wide_filtered + c, steering, at.channels, [&](int o, Vec v) {
                    const auto slot = std::int64_t(block.slots[o][i]);
                    float* const to = state + slot * at.wide_channels + c;
                    store(to, load(to) + v);
                });
        });
}

double multiply_adds(std::int64_t rounds) {
#if defined(VNCA_TILES)
    return tile_multiply_adds(rounds);
#endif
    constexpr int CHAINS = REGISTERS == 32 ? 24 : 12;  // more than wait for one another
    // No two alike, and none known to the compiler, which would compute equal ones once.
    volatile float start = 0.5f;
    Vec sum[CHAINS];
    for (int i = 0; i < CHAINS; ++i) sum[i] = Vec{} + (start + float(i));
    const Units half = (Units)(Vec{} + start);
    for (std::int64_t round = 0; round < rounds; ++round)
#pragma GCC unroll 24
        for (int i = 0; i < CHAINS; ++i) sum[i] = chained(sum[i], half);
    volatile float seen = 0;  // or nothing would have to be computed
    for (const Vec& each : sum) seen = seen + each[0];
    return 2.0 * double(rounds) * CHAINS * LANES * DEPTH;
}

#define TEXT(x) #x
#define NAME(x) TEXT(x)

}  // namespace

extern const Kernel kernel = {NAME(VNCA_TARGET), DEPTH > 1, sizes, pack, forward, forward_bricks,
                             backward, multiply_adds};

}  // namespace vnca::VNCA_TARGET
