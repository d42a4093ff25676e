// What stays as it is while an edit trains: one view of the base (the field, with the edits below this one), sampled
// once.
//
// The base's samples, densities and colours along S×S rays, the picture they give, and the masks M₊ and M₋ of this
// view. None of it carries a gradient.
#pragma once

#include "core/base/torch.h"
#include "core/edit/losses.h"

namespace fieldgraft {

struct FrozenPatch {
    int size = 0;             // S
    Tensor start;             // S²+1: of S² rays, row by row
    Tensor positions, delta;  // N×3, N
    Tensor density, color;    // N, N×3
    Tensor acting;            // int64, the samples at which g is evaluated; it counts as 0 at the others
    Tensor image, opacity;    // S²×3 without background, S²
    RegionMasks masks;        // S×S
    double area = 0;          // of M₊, pixels

    std::int64_t samples() const { return delta.size(0); }
    Tensor over(const Tensor& background) const;  // S×S×3: the base's picture over a colour
};

}  // namespace fieldgraft
