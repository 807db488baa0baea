#include "step.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <new>
#include <vector>

#include "crew.hpp"

namespace vnca {
namespace {

// Cells are divided among at most TASKS ranges, a division that does not depend on the number of
// threads: sums are then made in the same order whoever makes them.
constexpr std::int64_t TASKS = 64, SMALLEST = 1024;

struct Ranges {
    std::int64_t cells, length;
    int count;

    explicit Ranges(std::int64_t n)
        : cells(n),
          length(std::max(SMALLEST, (n + TASKS - 1) / TASKS)),
          count(int((n + length - 1) / length)) {}

    std::int64_t begin(int range) const { return range * length; }
    std::int64_t end(int range) const { return std::min(cells, (range + 1) * length); }
};

// Memory for vectors, filled with zeros.
class Floats {
public:
    explicit Floats(std::size_t size) : size_(size), data_(allocate(size)) {
        std::memset(data_.get(), 0, size * sizeof(float));
    }
    float* data() { return data_.get(); }
    std::size_t size() const { return size_; }

    void grow(std::size_t size) {
        if (size <= size_) return;
        size = std::max(size, 2 * size_);
        std::unique_ptr<float, Free> grown = allocate(size);
        std::memcpy(grown.get(), data_.get(), size_ * sizeof(float));
        std::memset(grown.get() + size_, 0, (size - size_) * sizeof(float));
        data_ = std::move(grown);
        size_ = size;
    }

private:
    static constexpr std::align_val_t LINE{64};
    struct Free {
        void operator()(float* p) const { ::operator delete(p, LINE); }
    };
    static std::unique_ptr<float, Free> allocate(std::size_t size) {
        return std::unique_ptr<float, Free>(
            static_cast<float*>(::operator new(size * sizeof(float), LINE)));
    }
    std::size_t size_;
    std::unique_ptr<float, Free> data_;
};

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

// What a range adds to the gradient of cells outside it, in the order of the ranges they are in.
struct Spill {
    std::vector<std::int32_t> rows;
    std::vector<float> values;        // [rows, channels]
    std::vector<std::int64_t> bounds;  // rows of range t are those from bounds[t] to bounds[t + 1]
};

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

        Spill spill;
        spill.bounds.assign(ranges.count + 1, 0);
        for (const std::int32_t row : others_) ++spill.bounds[row / ranges.length + 1];
        for (int t = 0; t < ranges.count; ++t) spill.bounds[t + 1] += spill.bounds[t];
        spill.rows.resize(others_.size());
        spill.values.resize(others_.size() * channels_);
        std::vector<std::int64_t> next(spill.bounds.begin(), spill.bounds.end() - 1);
        for (const std::int32_t row : others_) {
            const std::int64_t at = next[row / ranges.length]++;
            spill.rows[at] = row;
            std::memcpy(&spill.values[at * channels_], sum, channels_ * sizeof(float));
            sum += stride_;
        }

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

bool runs_avx512() {
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
#else
    return false;
#endif
}

bool runs_avx2() {
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
    return false;
#endif
}

}  // namespace

const Kernel* const* kernels() {
    static const auto found = [] {
        std::vector<const Kernel*> list;
#if defined(__x86_64__)
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

bool forward(const Kernel& kernel, const Step& step, Rows rows, float* out, int threads) {
    const Sizes sizes = kernel.sizes(step);
    const Ranges ranges(step.cells);
    threads = std::max(1, std::min(threads, ranges.count));
    Floats packed(sizes.packed);
    kernel.pack(step, packed.data());
    std::vector<Floats> scratch;
    for (int t = 0; t < threads; ++t) scratch.emplace_back(sizes.scratch);
    std::atomic<bool> valid = true;

    Crew::of_process().run(ranges.count, threads, [&](int range, int worker) {
        const std::int64_t begin = ranges.begin(range), end = ranges.end(range);
        std::memcpy(out + begin * step.channels, step.state + begin * step.channels,
                    (end - begin) * step.channels * sizeof(float));
        const auto visit = [&](const Block& block) {
            kernel.forward(step, packed.data(), block, scratch[worker].data(), out);
        };
        if (!each_block(step, rows, begin, end, visit)) valid = false;
    });
    std::memcpy(out + step.cells * step.channels, step.state + step.cells * step.channels,
                step.channels * sizeof(float));
    return valid;
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
    Crew& crew = Crew::of_process();

    crew.run(ranges.count, threads, [&](int range, int worker) {
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

    crew.run(ranges.count, threads, [&](int range, int) {
        for (const Spill& spill : spills)
            for (std::int64_t i = spill.bounds[range]; i < spill.bounds[range + 1]; ++i)
                for (int c = 0; c < channels; ++c)
                    to.state[std::int64_t(spill.rows[i]) * channels + c] +=
                        spill.values[i * channels + c];
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
