// The kernels' parallel_for over libtorch's thread pool: one pool in the process, sized by --threads.
#pragma once

#include <algorithm>
#include <atomic>

#include "core/base/torch.h"
#include "core/kernels/parallel.h"

namespace fieldgraft {

inline void torch_parallel_for(std::int64_t count, std::int64_t grain, const RangeBody& body) {
    at::parallel_for(0, count, grain, [&](std::int64_t begin, std::int64_t end) { body(begin, end); });
}

// Calls body(i) for i = 0 … count − 1, each taken by the next thread that is free: for tasks of unlike length.
template <class Body>
void share_out(std::int64_t count, Body body) {
    std::atomic<std::int64_t> next{0};
    at::parallel_for(0, std::min<std::int64_t>(at::get_num_threads(), count), 1, [&](std::int64_t, std::int64_t) {
        for (std::int64_t i = next++; i < count; i = next++) body(i);
    });
}

}  // namespace fieldgraft
