// Shapes made of cells: R×R×R uint8 (z, y, x) over the field's box.
#pragma once

#include "core/base/torch.h"
#include "core/field/geometry.h"

namespace fieldgraft {

// Where density may be added when it goes on top of something (Blending-NeRF's `add`, "with a hat"): a ball on the
// region's highest part, as wide as `width` of the lesser of the region's horizontal extents, sunk a little into what
// it stands on. `up` is the geometry's. region: bool or uint8; throws std::invalid_argument for an empty one.
Tensor cells_above(const FieldGeometry& geometry, const Tensor& region, double width);

// `cells` (bool or uint8) without the pieces, connected over faces, edges or corners, that have fewer than `share` of
// the largest piece's cells.
Tensor without_specks(const Tensor& cells, double share);

// The pieces of `whole` that would be left hanging when `part` goes: those of `whole` without `part` with fewer than
// `share` of the largest piece's cells. Cells as above; returns uint8.
Tensor cut_off_pieces(const Tensor& whole, const Tensor& part, double share);

}  // namespace fieldgraft
