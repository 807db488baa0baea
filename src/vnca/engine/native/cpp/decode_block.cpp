// The work of decoding on one block of points, see vector.hpp for how it is compiled.

#include "decode_block.hpp"

#include "multiply.hpp"
#include "sine.hpp"
#include "srgb.hpp"
#include "vector.hpp"

namespace vnca::VNCA_TARGET {
namespace {

// ---- Where things lie ------------------------------------------------------------------------

// Of a layer: its packed weights, and the inputs that it gets in scratch.
struct Place {
    int inputs, outputs;
    std::size_t wide_inputs, wide;  // whole vectors of inputs and outputs
    std::size_t rows;               // of the gradient of [weights | bias]ᵀ, whole tiles
    std::size_t stride;             // of a point's inputs
    std::size_t forward, backward, bias;
    std::size_t gradient;
};

struct Layout {
    int channels;
    std::size_t wide_channels;
    std::int64_t safe_rows;  // rows of the state that can be read in whole vectors
    std::size_t tail_rows;
    Place layers[LAYERS];
    std::size_t tail, packed, gradient, output_stride, inputs;

    explicit Layout(const Decoder& d) {
        channels = d.channels;
        wide_channels = round_up(channels, LANES);
        safe_rows = d.cells + 2 - std::int64_t(round_up(wide_channels, channels) / channels);
        if (safe_rows < 0) safe_rows = 0;
        tail_rows = std::size_t(d.cells + 1 - safe_rows);
        packed = gradient = inputs = 0;
        for (int l = 0; l < LAYERS; ++l) {
            Place& at = layers[l];
            at.inputs = d.layers[l].inputs;
            at.outputs = d.layers[l].outputs;
            at.wide_inputs = round_up(at.inputs, LANES);
            at.wide = round_up(at.outputs, LANES);
            at.rows = round_up(at.inputs + 1, HEIGHTS);
            at.stride = stride_of(at.rows > at.wide_inputs ? at.rows : at.wide_inputs);
            at.forward = packed;
            at.backward = at.forward + panels_size(at.inputs, at.outputs);
            at.bias = at.backward + panels_size(at.outputs, at.inputs);
            packed = at.bias + at.wide;
            at.gradient = gradient;
            gradient += at.rows * at.wide;
            inputs += at.stride;
        }
        output_stride = stride_of(layers[LAYERS - 1].wide);
        tail = packed;
        packed += tail_rows * wide_channels;
    }
};

DecodeSizes sizes(const Decoder& d) {
    const Layout at(d);
    DecodeSizes result;
    result.packed = at.packed;
    // Inputs of all layers, the cosines of those that are sines, and two gradients.
    std::size_t widest = at.output_stride;
    for (const Place& layer : at.layers) widest = layer.stride > widest ? layer.stride : widest;
    result.scratch = BLOCK * (2 * at.inputs + 2 * widest);
    result.channels = at.wide_channels;
    result.gradient = at.gradient;
    for (int l = 0; l < LAYERS; ++l) {
        result.begin[l] = at.layers[l].gradient;
        result.width[l] = at.layers[l].wide;
    }
    return result;
}

void pack(const Decoder& d, float* packed) {
    const Layout at(d);
    for (int l = 0; l < LAYERS; ++l) {
        const Place& to = at.layers[l];
        const Layer& layer = d.layers[l];
        const auto weight = [&](int output, int input) {
            return layer.weights[std::size_t(output) * layer.inputs + input];
        };
        pack_panels(packed + to.forward, to.inputs, to.outputs,
                    [&](int input, int output) { return weight(output, input); });
        pack_panels(packed + to.backward, to.outputs, to.inputs, weight);
        for (int j = 0; j < int(to.wide); ++j)
            packed[to.bias + j] = j < to.outputs ? layer.bias[j] : 0.0f;
    }
    for (std::size_t row = 0; row < at.tail_rows; ++row) {
        float* const to = packed + at.tail + row * at.wide_channels;
        const float* const from = d.state + (at.safe_rows + row) * d.channels;
        for (int c = 0; c < int(at.wide_channels); ++c) to[c] = c < d.channels ? from[c] : 0.0f;
    }
}

// ---- One block -------------------------------------------------------------------------------

// Numbers of a block's points, a row each.
struct Matrix {
    float* data;
    std::size_t stride;

    INLINE float* row(int point) const { return data + point * stride; }
    INLINE Left left() const { return {data, stride, 1}; }
    INLINE Left transposed() const { return {data, 1, stride}; }
    INLINE InRows rows() const { return {data, stride}; }
};

// One thread's working memory, cut into pieces.
class Scratch {
public:
    explicit Scratch(float* memory) : next_(memory) {}

    Matrix matrix(std::size_t stride) {
        float* const piece = next_;
        next_ += BLOCK * stride;
        return {piece, stride};
    }

private:
    float* next_;
};

// The state at the points, between the cells. A one behind it meets the gradient of the bias.
INLINE void interpolate(const Decoder& d, const Layout& at, const float* packed,
                        const Points& points, Matrix to) {
    const float* const tail = packed + at.tail;
    for (int i = 0; i < points.count; ++i) {
        const float* from[CORNERS];
        for (int k = 0; k < CORNERS; ++k) {
            const std::int64_t row = points.corners[k][i];
            from[k] = row < at.safe_rows ? d.state + row * at.channels
                                         : tail + (row - at.safe_rows) * at.wide_channels;
        }
        float* const row = to.row(i);
        for (std::size_t c = 0; c < at.wide_channels; c += LANES) {
            Vec sum = points.shares[0][i] * load(from[0] + c);
            for (int k = 1; k < CORNERS; ++k) sum += points.shares[k][i] * load(from[k] + c);
            store(row + c, sum);
        }
        row[at.channels] = 1.0f;
    }
}

// The sines of a layer, and their cosines where asked for, with a one behind the sines.
template <bool Cosine>
INLINE void sine_layer(const Place& at, const float* packed, int count, Matrix from, Matrix to,
                       Matrix cosines) {
    const float* const bias = packed + at.bias;
    multiply(count, int(at.wide), at.inputs, from.left(),
             InPanels{packed + at.forward, std::size_t(at.inputs)},
             [&](int i, int j, Vec v) { store(to.row(i) + j, v + load(bias + j)); });
    for (int i = 0; i < count; ++i) {
        sines<Cosine>(to.row(i), cosines.row(i), at.wide);
        to.row(i)[at.outputs] = 1.0f;
    }
}

void forward(const Decoder& d, const float* packed, const Points& points, float* memory,
             float* out) {
    const Layout at(d);
    Scratch scratch(memory);
    Matrix inputs[LAYERS];
    for (int l = 0; l < LAYERS; ++l) inputs[l] = scratch.matrix(at.layers[l].stride);

    interpolate(d, at, packed, points, inputs[0]);
    for (int l = 0; l + 1 < LAYERS; ++l)
        sine_layer<false>(at.layers[l], packed, points.count, inputs[l], inputs[l + 1], {});
    const Place& last = at.layers[LAYERS - 1];
    const Vec bias = load(packed + last.bias);
    multiply(points.count, int(last.wide), last.inputs, inputs[LAYERS - 1].left(),
             InPanels{packed + last.forward, std::size_t(last.inputs)}, [&](int i, int, Vec v) {
                 if (i >= points.count) return;
                 v += bias + load(inputs[0].row(i));
                 std::memcpy(out + i * SHOWN, &v, SHOWN * sizeof(float));
             });
}

INLINE Ints lanes_of_density() {
    static_assert(LANES % SHOWN == 0);
    Ints of_density;
    for (int lane = 0; lane < LANES; ++lane) of_density[lane] = lane % SHOWN == SHOWN - 1 ? -1 : 0;
    return of_density;
}

void light(float* seen, int points, float most) {
    const Ints of_density = lanes_of_density();
    for (int j = 0; j < points * SHOWN; j += LANES) {
        const Vec v = load(seen + j);
        const Vec colour = linear_light(limited(v + 0.5f, 0, 1));
        store(seen + j, chosen(of_density, limited(v, -most, most), colour));
    }
}

void light_backward(const float* seen, float* gradient, int points, float most) {
    const Ints of_density = lanes_of_density();
    for (int j = 0; j < points * SHOWN; j += LANES) {
        const Vec v = load(seen + j), srgb = v + 0.5f;
        const Vec steep = linear_light(limited(srgb, 0, 1)) / (srgb + 0.055f) * 2.4f;
        const Vec slope = chosen(srgb <= 0.04045f, Vec{} + 1 / 12.92f, steep);
        const Ints within = (of_density & (v >= -most) & (v <= most)) |
                            (~of_density & (srgb >= 0.0f) & (srgb <= 1.0f));
        const Vec g = load(gradient + j) * chosen(of_density, Vec{} + 1.0f, slope);
        store(gradient + j, chosen(within, g, Vec{}));
    }
}

void backward(const Decoder& d, const float* packed, const Points& points, const float* gradient,
              float* memory, float* to_weights, float* state) {
    const Layout at(d);
    Scratch scratch(memory);
    Matrix inputs[LAYERS], cosines[LAYERS];
    std::size_t widest = at.output_stride;
    for (int l = 0; l < LAYERS; ++l) {
        inputs[l] = scratch.matrix(at.layers[l].stride);
        cosines[l] = scratch.matrix(at.layers[l].stride);
        widest = at.layers[l].stride > widest ? at.layers[l].stride : widest;
    }
    Matrix to_outputs = scratch.matrix(widest), to_inputs = scratch.matrix(widest);

    interpolate(d, at, packed, points, inputs[0]);
    for (int l = 0; l + 1 < LAYERS; ++l)
        sine_layer<true>(at.layers[l], packed, points.count, inputs[l], inputs[l + 1],
                         cosines[l + 1]);
    for (int i = 0; i < points.count; ++i) {
        Vec g = {};
        std::memcpy(&g, gradient + i * SHOWN, SHOWN * sizeof(float));
        store(to_outputs.row(i), g);
    }

    for (int l = LAYERS - 1; l >= 0; --l) {
        const Place& layer = at.layers[l];
        float* const to_layer = to_weights + layer.gradient;
        multiply(layer.inputs + 1, int(layer.wide), points.count, inputs[l].transposed(),
                 to_outputs.rows(), [&](int row, int j, Vec v) {
                     float* const to = to_layer + row * layer.wide + j;
                     store(to, load(to) + v);
                 });
        multiply(points.count, int(layer.wide_inputs), layer.outputs, to_outputs.left(),
                 InPanels{packed + layer.backward, std::size_t(layer.outputs)},
                 [&](int i, int j, Vec v) {
                     if (l > 0) v *= load(cosines[l].row(i) + j);
                     store(to_inputs.row(i) + j, v);
                 });
        const Matrix done = to_outputs;
        to_outputs = to_inputs;
        to_inputs = done;
    }

    for (int i = 0; i < points.count; ++i) {
        float* const to_state = to_outputs.row(i);  // of the inputs of the first layer by now
        for (int c = 0; c < SHOWN; ++c) to_state[c] += gradient[i * SHOWN + c];
        for (int k = 0; k < CORNERS; ++k) {
            float* const to = state + points.slots[k][i] * std::int64_t(at.wide_channels);
            for (std::size_t c = 0; c < at.wide_channels; c += LANES)
                store(to + c, load(to + c) + points.shares[k][i] * load(to_state + c));
        }
    }
}

#define TEXT(x) #x
#define NAME(x) TEXT(x)

}  // namespace

extern const DecodeKernel decode_kernel = {NAME(VNCA_TARGET), sizes, pack, forward,
                                            light, light_backward, backward};

}  // namespace vnca::VNCA_TARGET
