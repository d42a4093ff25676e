// The pixels of a training patch (Blending-NeRF, sec. 4.3): an S×S grid that spans the view,
//
//   stride ⌊W/S⌋ and ⌊H/S⌋, start uniform in {0 … ⌊W/S⌋ + (W mod S) − 1} and likewise for H,
//
// so that every pixel of the view can be drawn and none lies outside.
#pragma once

#include "core/base/random.h"
#include "core/base/torch.h"

namespace fieldgraft {

struct Patch {
    std::int64_t start_x = 0, start_y = 0, stride_x = 1, stride_y = 1, size = 0;
    // (S·S)×2 int64 (x, y), row by row.
    Tensor pixels() const;
};

// Throws InputError if the view is smaller than the patch.
Patch sample_patch(int width, int height, int size, Random& random);

}  // namespace fieldgraft
