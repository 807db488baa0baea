// Working memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <new>
#include <utility>

namespace vnca {

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

}  // namespace vnca
