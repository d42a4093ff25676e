// Helpers of the kernel tests: random fills, finite differences, a parallel_for that splits ranges in two.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <vector>

#include "core/kernels/parallel.h"

namespace fieldgraft::testing {

template <class T>
std::vector<T> random_values(std::size_t count, unsigned seed, double low = -1, double high = 1) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(low, high);
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(uniform(engine));
    return values;
}

// Central difference of f with respect to one number.
inline double slope(double& x, double h, const std::function<double()>& f) {
    const double kept = x;
    x = kept + h;
    const double above = f();
    x = kept - h;
    const double below = f();
    x = kept;
    return (above - below) / (2 * h);
}

template <class T>
double dot(const std::vector<T>& a, const std::vector<T>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
    return sum;
}

// Ranges in the wrong order and as short as the grain allows: what must not matter.
inline void backwards_for(std::int64_t count, std::int64_t grain, const RangeBody& body) {
    for (std::int64_t first = (count - 1) / grain * grain; first >= 0 && count > 0; first -= grain) {
        body(first, first + grain < count ? first + grain : count);
    }
}

}  // namespace fieldgraft::testing
