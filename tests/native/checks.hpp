// What the tests of the native kernels have in common.

#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

namespace vnca {

constexpr int THREADS[] = {1, 2, 3, 8};

inline void expect(bool holds, const std::string& what) {
    if (holds) return;
    std::fprintf(stderr, "failed: %s\n", what.c_str());
    std::exit(1);
}

// The norm of the difference over the norm.
inline double error(const std::vector<float>& got, const std::vector<double>& expected) {
    double difference = 0, norm = 1e-30;
    for (std::size_t i = 0; i < got.size(); ++i) {
        difference += (got[i] - expected[i]) * (got[i] - expected[i]);
        norm += expected[i] * expected[i];
    }
    return std::sqrt(difference / norm);
}

// Whether `compute(threads)` gives the same when several threads call it at the same time.
template <class Compute>
void expect_the_same_of_callers(const Compute& compute) {
    const auto alone = compute(1);
    std::vector<std::thread> callers;
    for (int caller = 0; caller < 3; ++caller)
        callers.emplace_back([&] {
            for (const int threads : THREADS)
                expect(compute(threads) == alone, "callers disturb each other");
        });
    for (std::thread& caller : callers) caller.join();
}

}  // namespace vnca
