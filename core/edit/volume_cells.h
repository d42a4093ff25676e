// Cells that density may be added to when it goes on top of something (Blending-NeRF's `add`, "with a hat").
//
// An upright cylinder over the region's highest part, as wide as `width` of the region's horizontal extent and as high
// as it is wide, sunk a little into what it stands on. R×R×R uint8 (z, y, x) over the field's box; `up` is the
// geometry's.
#pragma once

#include "core/base/torch.h"
#include "core/field/geometry.h"

namespace fieldgraft {

// region: R×R×R bool or uint8; throws std::invalid_argument for an empty one.
Tensor cells_above(const FieldGeometry& geometry, const Tensor& region, double width);

}  // namespace fieldgraft
