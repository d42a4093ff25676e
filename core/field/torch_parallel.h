// The kernels' parallel_for over libtorch's thread pool: one pool in the process, sized by --threads.
#pragma once

#include "core/base/torch.h"
#include "core/kernels/parallel.h"

namespace fieldgraft {

inline void torch_parallel_for(std::int64_t count, std::int64_t grain, const RangeBody& body) {
    at::parallel_for(0, count, grain, [&](std::int64_t begin, std::int64_t end) { body(begin, end); });
}

}  // namespace fieldgraft
