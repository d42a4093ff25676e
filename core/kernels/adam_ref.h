// One step of Adam (Kingma & Ba 2015) over a flat span of parameters: reference kernel.
//
//   m = β1 m + (1 − β1) g,  v = β2 v + (1 − β2) g²,  p −= rate · (m / (1 − β1^t)) / (√(v / (1 − β2^t)) + ε)
//
// skip_zero leaves every entry whose gradient is exactly 0 as it is, moments too: hash-table entries that no sample of
// this step touched keep their history instead of fading (and cost one read). t counts steps from 1. Entries are
// independent: bits do not depend on how they are split between threads.
#pragma once

#include <cstdint>
#include <span>

#include "core/kernels/parallel.h"

namespace fieldgraft {

struct AdamStep {
    double rate = 1e-2, beta1 = 0.9, beta2 = 0.99, epsilon = 1e-15;
    std::int64_t t = 1;
    bool skip_zero = false;
};

template <class T>
void adam_step(const AdamStep& step, std::span<const T> grad, std::span<T> parameters, std::span<T> m, std::span<T> v,
               const ParallelFor& parallel_for);

// True if no value is NaN or infinite.
template <class T>
bool all_finite(std::span<const T> values, const ParallelFor& parallel_for);

}  // namespace fieldgraft
