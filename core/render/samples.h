// Packed samples along rays: ray r owns samples start[r] … start[r+1]−1, nearest first (the layout of nerfacc).
#pragma once

#include "core/base/torch.h"

namespace fieldgraft {

struct RayBundle {
    Tensor origins;     // R×3 float32, model coordinates
    Tensor directions;  // R×3 float32, unit length
    std::int64_t size() const { return origins.size(0); }
};

struct Samples {
    Tensor start;      // (R+1) int64
    Tensor ray;        // N int64, the ray each sample lies on
    Tensor positions;  // N×3 float32
    Tensor t;          // N float32, distance of the interval's middle
    Tensor delta;      // N float32, length of the interval
    std::int64_t size() const { return t.size(0); }
};

}  // namespace fieldgraft
