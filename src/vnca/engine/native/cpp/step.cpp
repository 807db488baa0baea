#include "step.hpp"

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

// Looks up the neighbours of a block's cells; false if one is out of range. What is dereferenced
// later is this copy.
bool find_neighbours(const Step& step, Block& block) {
    std::uint32_t largest = 0;
    for (int o = 0; o < NEIGHBOURS; ++o) {
        const std::int32_t* const from = step.neighbours + o * step.cells;
        for (int i = 0; i < block.count; ++i) {
            const std::int32_t row = from[block.rows[i]];
            block.around[o][i] = row;
            largest = std::max(largest, std::uint32_t(row));
        }
    }
    return std::int64_t(largest) <= step.cells;
}

// Brings the neighbours of a few cells, in ascending rows, closer while others are worked on. Where
// the cells lie far apart, only those of the first: it takes a line for every few cells.
void fetch_neighbours(const Step& step, const std::int32_t* rows, std::int64_t count) {
    constexpr int LINE = 64 / sizeof(std::int32_t), FURTHEST = 4 * BLOCK;
    if (count == 0) return;
    const std::int64_t first = rows[0];
    const std::int64_t last = std::min<std::int64_t>(rows[count - 1], first + FURTHEST);
    for (int o = 0; o < NEIGHBOURS; ++o) {
        const std::int32_t* const from = step.neighbours + o * step.cells;
        for (std::int64_t cell = first; cell < last; cell += LINE) __builtin_prefetch(from + cell);
        __builtin_prefetch(from + last);
    }
}

// Calls visit(block) for all rows within [begin, end), block by block; false if one goes wrong.
template <class Visit>
bool each_block(const Step& step, Rows rows, std::int64_t begin, std::int64_t end,
                const Visit& visit) {
    const std::int32_t* row = std::lower_bound(rows.data, rows.data + rows.count, begin);
    const std::int32_t* const last = std::lower_bound(row, rows.data + rows.count, end);
    Block block;
    for (; row < last; row += block.count) {
        block.rows = row;
        block.count = int(std::min<std::int64_t>(BLOCK, last - row));
        if (!find_neighbours(step, block)) return false;
        const std::int32_t* const next = row + block.count;
        fetch_neighbours(step, next, std::min<std::int64_t>(BLOCK, last - next));
        visit(block);
    }
    return true;
}

// Sums the gradient of the state that the cells of one range cause. Every row that is met gets a
// slot: first those of the range, then one for the outside, then the others as they come.
class Gathering {
public:
    Gathering(const Step& step, std::size_t stride, std::int64_t longest)
        : cells_(step.cells),
          channels_(step.channels),
          stride_(stride),
          slot_of_(step.cells + 1, -1),
          sums_((longest + 1 + NEIGHBOURS * BLOCK) * stride) {}

    void start(std::int64_t begin, std::int64_t end) {
        begin_ = begin;
        end_ = end;
        for (std::int64_t row = begin; row < end; ++row)
            slot_of_[row] = std::int32_t(row - begin);
        slot_of_[cells_] = std::int32_t(end - begin);
        std::memset(sums_.data(), 0, sums_.size() * sizeof(float));
    }

    void give_slots(Block& block) {
        for (int o = 0; o < NEIGHBOURS; ++o)
            for (int i = 0; i < block.count; ++i) {
                std::int32_t& slot = slot_of_[block.around[o][i]];
                if (slot < 0) {
                    slot = std::int32_t(end_ - begin_ + 1 + std::int64_t(others_.size()));
                    others_.push_back(block.around[o][i]);
                }
                block.slots[o][i] = slot;
            }
        sums_.grow((end_ - begin_ + 1 + others_.size()) * stride_);
    }

    float* sums() { return sums_.data(); }

    // Writes the gradient of the range's own cells, which itself passes straight through a step,
    // and returns the rest.
    Spill finish(const Ranges& ranges, const float* gradient, float* to_state) {
        const float* sum = sums_.data();
        for (std::int64_t row = begin_; row < end_; ++row, sum += stride_)
            for (int c = 0; c < channels_; ++c)
                to_state[row * channels_ + c] = gradient[row * channels_ + c] + sum[c];
        sum += stride_;  // of the outside, which is a constant

        Spill spill = Spill::of(others_, sum, stride_, channels_, ranges);
        std::fill(slot_of_.begin() + begin_, slot_of_.begin() + end_, -1);
        for (const std::int32_t row : others_) slot_of_[row] = -1;
        others_.clear();
        return spill;
    }

private:
    std::int64_t cells_, begin_ = 0, end_ = 0;
    int channels_;
    std::size_t stride_;
    std::vector<std::int32_t> slot_of_, others_;
    Floats sums_;
};

}  // namespace

const Kernel* const* kernels() {
    static const auto found = [] {
        std::vector<const Kernel*> list;
#if defined(__x86_64__)
#if defined(VNCA_AMXBF16)
        if (runs_avx512() && __builtin_cpu_supports("avx512bf16") && runs_tiles())
            list.push_back(&amxbf16::kernel);
#endif
#if defined(VNCA_AVX512BF16)
        if (runs_avx512() && __builtin_cpu_supports("avx512bf16"))
            list.push_back(&avx512bf16::kernel);
#endif
        if (runs_avx512()) list.push_back(&avx512::kernel);
        if (runs_avx2()) list.push_back(&avx2::kernel);
#endif
        list.push_back(&portable::kernel);
        list.push_back(nullptr);
        return list;
    }();
    return found.data();
}

namespace {

// Calls write(begin, end, packed, scratch) for ranges of cells; false if one goes wrong.
template <class Write>
bool each_range(const Kernel& kernel, const Step& step, float* out, int threads,
                const Write& write) {
    const Sizes sizes = kernel.sizes(step);
    const Ranges ranges(step.cells);
    threads = std::max(1, std::min(threads, ranges.count));
    Floats packed(sizes.packed);
    kernel.pack(step, packed.data());
    std::vector<Floats> scratch;
    for (int t = 0; t < threads; ++t) scratch.emplace_back(sizes.scratch + sizes.brick);
    std::atomic<bool> valid = true;

    ThreadPool::of_process().run(ranges.count, threads, [&](int range, int worker) {
        if (!write(ranges.begin(range), ranges.end(range), packed.data(), scratch[worker].data()))
            valid = false;
    });
    std::memcpy(out + step.cells * step.channels, step.state + step.cells * step.channels,
                step.channels * sizeof(float));
    return valid;
}

}  // namespace

bool forward(const Kernel& kernel, const Step& step, Rows rows, float* out, int threads) {
    return each_range(kernel, step, out, threads,
                      [&](std::int64_t begin, std::int64_t end, const float* packed, float* scratch) {
                          std::memcpy(out + begin * step.channels,
                                      step.state + begin * step.channels,
                                      (end - begin) * step.channels * sizeof(float));
                          return each_block(step, rows, begin, end, [&](const Block& block) {
                              kernel.forward(step, packed, block, scratch, out);
                          });
                      });
}

bool forward(const Kernel& kernel, const Step& step, const Bricks& bricks, const Mask& mask,
             float* out, int threads) {
    return each_range(kernel, step, out, threads,
                      [&](std::int64_t begin, std::int64_t end, const float* packed, float* scratch) {
                          return kernel.forward_bricks(step, packed, bricks, mask, begin, end,
                                                       scratch, out);
                      });
}

bool backward(const Kernel& kernel, const Step& step, Rows rows, const float* gradient,
              Gradients to, int threads) {
    const Sizes sizes = kernel.sizes(step);
    const Ranges ranges(step.cells);
    const int channels = step.channels;
    threads = std::max(1, std::min(threads, ranges.count));
    Floats packed(sizes.packed);
    kernel.pack(step, packed.data());
    std::vector<Floats> scratch;
    std::vector<Gathering> gatherings;
    for (int t = 0; t < threads; ++t) {
        scratch.emplace_back(sizes.scratch);
        gatherings.emplace_back(step, sizes.channels, ranges.length);
    }
    Floats weights(std::max(1, ranges.count) * sizes.gradient());
    std::vector<Spill> spills(ranges.count);
    std::atomic<bool> valid = true;
    ThreadPool& thread_pool = ThreadPool::of_process();

    thread_pool.run(ranges.count, threads, [&](int range, int worker) {
        Gathering& gathering = gatherings[worker];
        float* const to_weights = weights.data() + range * sizes.gradient();
        gathering.start(ranges.begin(range), ranges.end(range));
        const auto visit = [&](Block& block) {
            gathering.give_slots(block);
            kernel.backward(step, packed.data(), block, gradient, scratch[worker].data(),
                            to_weights, gathering.sums());
        };
        if (!each_block(step, rows, ranges.begin(range), ranges.end(range), visit)) valid = false;
        spills[range] = gathering.finish(ranges, gradient, to.state);
    });
    if (!valid) return false;

    thread_pool.run(ranges.count, threads, [&](int range, int) {
        for (const Spill& spill : spills) spill.add_to(to.state, channels, range);
    });
    std::fill_n(to.state + step.cells * channels, channels, 0.0f);

    float* const total = weights.data();
    for (int range = 1; range < ranges.count; ++range)
        for (std::size_t i = 0; i < sizes.gradient(); ++i)
            total[i] += weights.data()[range * sizes.gradient() + i];
    const int inputs = step.inputs();
    for (int unit = 0; unit < step.hidden; ++unit) {
        for (int k = 0; k < inputs; ++k) {
            const float scale = k < FILTERS * channels ? step.scale[k / channels] : 1.0f;
            to.first[std::int64_t(unit) * inputs + k] = scale * total[k * sizes.hidden + unit];
        }
        to.bias[unit] = total[inputs * sizes.hidden + unit];
    }
    const float* const second = total + sizes.first_rows * sizes.hidden;
    for (int c = 0; c < channels; ++c)
        std::memcpy(to.second + std::int64_t(c) * step.hidden, second + c * sizes.hidden,
                    step.hidden * sizeof(float));
    return true;
}

}  // namespace vnca
