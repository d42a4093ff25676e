// How a kernel asks for threads without knowing any thread library.
//
// parallel_for(count, grain, body) calls body(begin, end) for disjoint ranges that cover [0, count), in any order,
// possibly at once, and returns when all are done. Ranges shorter than `grain` are not split further. An exception
// thrown by body reaches the caller. Kernels give the same bits for every way of splitting unless their header says
// otherwise.
#pragma once

#include <cstdint>
#include <functional>

namespace fieldgraft {

using RangeBody = std::function<void(std::int64_t begin, std::int64_t end)>;
using ParallelFor = std::function<void(std::int64_t count, std::int64_t grain, const RangeBody& body)>;

// Everything in the caller's thread.
inline void serial_for(std::int64_t count, std::int64_t /*grain*/, const RangeBody& body) {
    if (count > 0) body(0, count);
}

}  // namespace fieldgraft
