#include "decode.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "thread_pool.hpp"
#include "floats.hpp"
#include "processor.hpp"
#include "ranges.hpp"

namespace vnca {
namespace {

// What each of the eight corners counts, z fastest.
void share_out(const float* fraction, float* share, std::size_t stride) {
    for (int k = 0; k < CORNERS; ++k) {
        const float x = k & 4 ? fraction[0] : 1 - fraction[0];
        const float y = k & 2 ? fraction[1] : 1 - fraction[1];
        const float z = k & 1 ? fraction[2] : 1 - fraction[2];
        share[k * stride] = x * y * z;
    }
}

// Calls visit(begin, points) for all points of a range, block by block; false if one goes wrong.
template <class Visit>
bool each_block(const Decoder& decoder, const PointSource& source, std::int64_t begin,
                std::int64_t end, const Visit& visit) {
    Points points;
    for (; begin < end; begin += points.count) {
        points.count = int(std::min<std::int64_t>(BLOCK, end - begin));
        if (!source.find(decoder, begin, points)) return false;
        visit(begin, points);
    }
    return true;
}

// What seeing takes: the weights, shared by all threads, and room for each.
struct Seeing {
    const DecodeKernel& kernel;
    const Decoder& decoder;
    Floats packed;
    std::vector<Floats> scratch;

    Seeing(const DecodeKernel& with, const Decoder& what, int threads)
        : kernel(with), decoder(what), packed(with.sizes(what).packed) {
        kernel.pack(decoder, packed.data());
        for (int t = 0; t < threads; ++t) scratch.emplace_back(kernel.sizes(decoder).scratch);
    }

    void operator()(const Points& points, int worker, float* out) {
        kernel.forward(decoder, packed.data(), points, scratch[worker].data(), out);
    }
};

// Sums the gradient of the state that the points of one range cause. Every row that is met gets a
// slot: the outside the first, the others as they come.
class Gathering {
public:
    Gathering(const Decoder& decoder, std::size_t stride)
        : cells_(decoder.cells),
          channels_(decoder.channels),
          stride_(stride),
          slot_of_(decoder.cells + 1, -1),
          sums_(stride) {
        slot_of_[cells_] = 0;
    }

    void give_slots(Points& points) {
        for (int k = 0; k < CORNERS; ++k)
            for (int i = 0; i < points.count; ++i) {
                std::int32_t& slot = slot_of_[points.corners[k][i]];
                if (slot < 0) {
                    met_.push_back(points.corners[k][i]);
                    slot = std::int32_t(met_.size());
                }
                points.slots[k][i] = slot;
            }
        sums_.grow((met_.size() + 1) * stride_);
    }

    float* sums() { return sums_.data(); }

    // What came together, by owners of the cells; then all is as at the beginning.
    Spill finish(const Ranges& owners) {
        Spill spill = Spill::of(met_, sums_.data() + stride_, stride_, channels_, owners);
        std::memset(sums_.data(), 0, (met_.size() + 1) * stride_ * sizeof(float));
        for (const std::int32_t row : met_) slot_of_[row] = -1;
        met_.clear();
        return spill;
    }

private:
    std::int64_t cells_;
    int channels_;
    std::size_t stride_;
    std::vector<std::int32_t> slot_of_, met_;
    Floats sums_;
};

}  // namespace

const DecodeKernel* const* decode_kernels() {
    static const auto found = [] {
        std::vector<const DecodeKernel*> list;
#if defined(__x86_64__)
        if (runs_avx512()) list.push_back(&avx512::decode_kernel);
        if (runs_avx2()) list.push_back(&avx2::decode_kernel);
#endif
        list.push_back(&portable::decode_kernel);
        list.push_back(nullptr);
        return list;
    }();
    return found.data();
}

bool Scattered::find(const Decoder& decoder, std::int64_t begin, Points& points) const {
    std::uint32_t largest = 0;
    for (int k = 0; k < CORNERS; ++k) {
        const std::int32_t* const from = rows + k * count + begin;
        for (int i = 0; i < points.count; ++i) {
            points.corners[k][i] = from[i];
            largest = std::max(largest, std::uint32_t(from[i]));
        }
    }
    for (int i = 0; i < points.count; ++i)
        share_out(fractions + 3 * (begin + i), &points.shares[0][i], BLOCK);
    return std::int64_t(largest) <= decoder.cells;
}

Subdivided::Subdivided(const std::int32_t* cells, std::int64_t count_of_cells,
                       const std::int32_t* neighbours_of, int points_along)
    : PointSource(count_of_cells * points_along * points_along * points_along),
      chosen(cells),
      neighbours(neighbours_of),
      chosen_cells(count_of_cells),
      along(points_along),
      each(along * along * along) {
    for (int point = 0; point < each; ++point) {
        const int place[] = {point / (along * along), point / along % along, point % along};
        float fraction[3];
        int first = 0;  // neighbour at the first corner
        for (int axis = 0; axis < 3; ++axis) {
            const int twice = 2 * place[axis] + 1 - along;  // from the centre, in 1/2 parts
            first = 3 * first + (twice < 0 ? 0 : 1);
            const double from_centre = twice / (2.0 * along);
            fraction[axis] = float(twice < 0 ? from_centre + 1 : from_centre);
        }
        for (int k = 0; k < CORNERS; ++k)
            offsets[point][k] = std::int8_t(first + (k >> 2) * 9 + (k >> 1 & 1) * 3 + (k & 1));
        share_out(fraction, shares[point], 1);
    }
}

bool Subdivided::find(const Decoder& decoder, std::int64_t begin, Points& points) const {
    std::uint32_t largest = 0;
    std::int64_t at = begin / each;
    int point = int(begin % each);
    for (int i = 0; i < points.count; ++i) {
        const std::int32_t cell = chosen[at];
        if (cell < 0 || cell >= decoder.cells) return false;
        for (int k = 0; k < CORNERS; ++k) {
            const std::int32_t row = neighbours[offsets[point][k] * decoder.cells + cell];
            points.corners[k][i] = row;
            points.shares[k][i] = shares[point][k];
            largest = std::max(largest, std::uint32_t(row));
        }
        if (++point == each) {
            point = 0;
            ++at;
        }
    }
    return std::int64_t(largest) <= decoder.cells;
}

bool decode(const DecodeKernel& kernel, const Decoder& decoder, const PointSource& source,
            float* out, int threads) {
    const Ranges ranges(source.count);
    threads = std::max(1, std::min(threads, ranges.count));
    Seeing see(kernel, decoder, threads);
    std::atomic<bool> valid = true;

    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int worker) {
        const auto visit = [&](std::int64_t begin, const Points& points) {
            see(points, worker, out + begin * SHOWN);
        };
        if (!each_block(decoder, source, ranges.begin(range), ranges.end(range), visit))
            valid = false;
    });
    return valid;
}

bool decode_parts(const DecodeKernel& kernel, const Decoder& decoder, const Subdivided& source,
                  const Shown& to, int threads) {
    const int along = source.along, parts = along / to.samples, each = parts * parts * parts;
    std::int16_t part_of[Subdivided::MOST];
    for (int point = 0; point < source.each; ++point) {
        const int x = point / (along * along) / to.samples, y = point / along % along / to.samples;
        part_of[point] = std::int16_t((x * parts + y) * parts + point % along / to.samples);
    }
    const float share = float(each) / float(source.each);
    const Ranges ranges(source.chosen_cells, std::max<std::int64_t>(1, SMALLEST / source.each));
    threads = std::max(1, std::min(threads, ranges.count));
    Seeing see(kernel, decoder, threads);
    std::atomic<bool> valid = true;

    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int worker) {
        float seen[BLOCK * SHOWN] = {}, sums[Subdivided::MOST][SHOWN] = {};
        std::int64_t cell = ranges.begin(range);
        int point = 0;
        const auto visit = [&](std::int64_t, const Points& points) {
            see(points, worker, seen);
            kernel.light(seen, points.count, to.most);
            for (int i = 0; i < points.count; ++i) {
                float* const sum = sums[part_of[point]];
                for (int c = 0; c < SHOWN; ++c) sum[c] += seen[i * SHOWN + c];
                if (++point < source.each) continue;
                for (int part = 0; part < each; ++part) {
                    const std::int64_t at = cell * each + part;
                    for (int c = 0; c < SHOWN - 1; ++c)
                        to.colour[at * (SHOWN - 1) + c] = share * sums[part][c];
                    to.change[at] = share * sums[part][SHOWN - 1];
                }
                std::fill_n(sums[0], each * SHOWN, 0.0f);
                point = 0;
                ++cell;
            }
        };
        if (!each_block(decoder, source, cell * source.each, ranges.end(range) * source.each,
                        visit))
            valid = false;
    });
    return valid;
}

// Calls work(begin, count) for some points at a time, which with what they show fit into a cache.
template <class Work>
static void each_few(std::int64_t points, int threads, const Work& work) {
    const Ranges ranges(points, 4 * SMALLEST);
    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int) {
        for (std::int64_t begin = ranges.begin(range); begin < ranges.end(range); begin += BLOCK)
            work(begin, int(std::min<std::int64_t>(BLOCK, ranges.end(range) - begin)));
    });
}

void show(const DecodeKernel& kernel, const float* seen, std::int64_t points, float most,
          float* colour, float* factor, int threads) {
    each_few(points, threads, [&](std::int64_t begin, int count) {
        float some[BLOCK * SHOWN] = {};
        std::copy_n(seen + begin * SHOWN, count * SHOWN, some);
        kernel.light(some, count, most);
        for (int i = 0; i < count; ++i) {
            std::copy_n(some + i * SHOWN, SHOWN - 1, colour + (begin + i) * (SHOWN - 1));
            factor[begin + i] = 1 + some[i * SHOWN + SHOWN - 1];
        }
    });
}

void show_backward(const DecodeKernel& kernel, const float* seen, std::int64_t points, float most,
                   const float* of_colour, const float* of_factor, float* gradient, int threads) {
    each_few(points, threads, [&](std::int64_t begin, int count) {
        float some[BLOCK * SHOWN] = {}, to[BLOCK * SHOWN] = {};
        std::copy_n(seen + begin * SHOWN, count * SHOWN, some);
        for (int i = 0; i < count; ++i) {
            std::copy_n(of_colour + (begin + i) * (SHOWN - 1), SHOWN - 1, to + i * SHOWN);
            to[i * SHOWN + SHOWN - 1] = of_factor[begin + i];
        }
        kernel.light_backward(some, to, count, most);
        std::copy_n(to, count * SHOWN, gradient + begin * SHOWN);
    });
}

bool decode_backward(const DecodeKernel& kernel, const Decoder& decoder, const PointSource& source,
                     const float* gradient, const DecodeGradients& to, int threads) {
    const DecodeSizes sizes = kernel.sizes(decoder);
    const Ranges ranges(source.count), owners(decoder.cells);
    const int channels = decoder.channels;
    threads = std::max(1, std::min(threads, std::max(ranges.count, owners.count)));
    Floats packed(sizes.packed);
    kernel.pack(decoder, packed.data());
    std::vector<Floats> scratch;
    std::vector<Gathering> gatherings;
    for (int t = 0; t < std::max(1, std::min(threads, ranges.count)); ++t) {
        scratch.emplace_back(sizes.scratch);
        gatherings.emplace_back(decoder, sizes.channels);
    }
    Floats weights(std::max(1, ranges.count) * sizes.gradient);
    std::vector<Spill> spills(ranges.count);
    std::atomic<bool> valid = true;
    ThreadPool& thread_pool = ThreadPool::of_process();

    thread_pool.run(ranges.count, threads, [&](int range, int worker) {
        Gathering& gathering = gatherings[worker];
        const auto visit = [&](std::int64_t begin, Points& points) {
            gathering.give_slots(points);
            kernel.backward(decoder, packed.data(), points, gradient + begin * SHOWN,
                            scratch[worker].data(), weights.data() + range * sizes.gradient,
                            gathering.sums());
        };
        if (!each_block(decoder, source, ranges.begin(range), ranges.end(range), visit))
            valid = false;
        spills[range] = gathering.finish(owners);
    });
    if (!valid) return false;

    thread_pool.run(owners.count, threads, [&](int owner, int) {
        std::fill(to.state + owners.begin(owner) * channels, to.state + owners.end(owner) * channels,
                  0.0f);
        for (const Spill& spill : spills) spill.add_to(to.state, channels, owner);
    });
    std::fill_n(to.state + decoder.cells * channels, channels, 0.0f);

    float* const total = weights.data();
    for (int range = 1; range < ranges.count; ++range)
        for (std::size_t i = 0; i < sizes.gradient; ++i)
            total[i] += weights.data()[range * sizes.gradient + i];
    for (int l = 0; l < LAYERS; ++l) {
        const Layer& layer = decoder.layers[l];
        const float* const from = total + sizes.begin[l];
        for (int output = 0; output < layer.outputs; ++output) {
            for (int input = 0; input < layer.inputs; ++input)
                to.weights[l][std::int64_t(output) * layer.inputs + input] =
                    from[input * sizes.width[l] + output];
            to.biases[l][output] = from[layer.inputs * sizes.width[l] + output];
        }
    }
    return true;
}

}  // namespace vnca
