// e^−x and 1 − e^−x of many numbers: SIMD, dispatched at run time.
//
// x ≥ 0 (∞ too). Relative errors a few ε where the result is a normal number; below that it may be 0. NaN stays NaN.
// x and out may be the same.
#pragma once

#include <cstddef>

namespace fieldgraft {

void exp_negative(const float* x, std::size_t n, float* out);
void one_minus_exp_negative(const float* x, std::size_t n, float* out);

}  // namespace fieldgraft
