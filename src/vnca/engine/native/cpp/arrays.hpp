// Checks of the arrays that come from Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

namespace vnca {

namespace nb = nanobind;

using Input = nb::ndarray<nb::ro>;
using Output = nb::ndarray<>;

constexpr std::int64_t ANY = -1, MOST_CHANNELS = 64;

template <class T>
constexpr const char* NAME = "float32";
template <>
inline constexpr const char* NAME<std::int32_t> = "int32";
template <>
inline constexpr const char* NAME<std::int64_t> = "int64";
template <>
inline constexpr const char* NAME<std::uint8_t> = "uint8";

inline std::string text(const std::vector<std::int64_t>& shape) {
    std::string result = "[";
    for (const std::int64_t length : shape)
        result += (result.size() > 1 ? ", " : "") + (length == ANY ? "any" : std::to_string(length));
    return result + "]";
}

// The data of an array that must be of type T, of the given shape, contiguous and in main memory.
template <class T, class Array>
auto* data_of(const Array& array, const char* name, const std::vector<std::int64_t>& shape) {
    std::vector<std::int64_t> actual;
    for (std::size_t axis = 0; axis < array.ndim(); ++axis) actual.push_back(array.shape(axis));
    bool fits = actual.size() == shape.size();
    for (std::size_t axis = 0; fits && axis < shape.size(); ++axis)
        fits = shape[axis] == ANY || shape[axis] == actual[axis];
    if (!fits)
        throw nb::value_error(
            (std::string(name) + ": expected shape " + text(shape) + ", got " + text(actual)).c_str());
    if (array.dtype() != nb::dtype<T>())
        throw nb::value_error((std::string(name) + ": expected " + NAME<T>).c_str());
    std::int64_t stride = 1;
    bool contiguous = array.device_type() == nb::device::cpu::value;
    for (std::size_t axis = actual.size(); axis-- > 0; stride *= actual[axis])
        contiguous = contiguous && (actual[axis] < 2 || array.stride(axis) == stride);
    if (!contiguous && array.size() > 0)
        throw nb::value_error((std::string(name) + ": expected a contiguous array in main memory").c_str());
    if (reinterpret_cast<std::uintptr_t>(array.data()) % alignof(T) != 0)
        throw nb::value_error((std::string(name) + ": expected aligned numbers").c_str());
    if constexpr (std::is_same_v<Array, Input>) return static_cast<const T*>(array.data());
    else return static_cast<T*>(array.data());
}

// Lengths of a call, from the arrays that define them; an array of another rank gives zeros,
// which `data_of` then reports.
inline std::int64_t length(const Input& array, std::size_t axis) {
    return axis < array.ndim() ? std::int64_t(array.shape(axis)) : 0;
}

// A length that the native kernels can work with.
inline void in_range(const char* name, std::int64_t value, std::int64_t lowest,
                     std::int64_t highest) {
    if (value < lowest || value > highest)
        throw nb::value_error(("the native kernel works with " + std::to_string(lowest) + " to " +
                               std::to_string(highest) + " " + name + ", got " +
                               std::to_string(value)).c_str());
}

// A place in memory. What is written may share it with nothing else.
struct Extent {
    std::uintptr_t begin, end;

    template <class Array>
    Extent(const Array& array)
        : begin(reinterpret_cast<std::uintptr_t>(array.data())), end(begin + array.nbytes()) {}
};

inline void check_apart(const std::vector<Extent>& outputs, const std::vector<Extent>& inputs) {
    for (const Extent& output : outputs) {
        const auto overlaps = [&](const Extent& other) {
            return &other != &output && output.begin < other.end && other.begin < output.end;
        };
        if (std::any_of(inputs.begin(), inputs.end(), overlaps) ||
            std::any_of(outputs.begin(), outputs.end(), overlaps))
            throw nb::value_error("an output shares memory with another array");
    }
}

}  // namespace vnca
