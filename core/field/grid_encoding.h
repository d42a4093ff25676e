// The hash-grid encoding kernel as an autograd function, feature-major: N points → (levels·F)×N (Müller et al. 2022).
//
// positions N×3 float32 in model coordinates, brought to the unit cube by the box's corner and its longest edge; table
// entries×F. Differentiable in the table; not in positions. Bits do not depend on the number of threads.
#pragma once

#include <memory>

#include "core/base/torch.h"
#include "core/field/geometry.h"
#include "core/kernels/hash_grid_ref.h"

namespace fieldgraft {

// Dense levels of the given cells along the longest edge; hashed to 2^log2_table_size entries where that is less.
HashGrid make_level_grid(const std::vector<int>& resolutions, int features, int log2_table_size);

Tensor encode_positions(const std::shared_ptr<const HashGrid>& grid, const FieldGeometry& geometry,
                        const Tensor& positions, const Tensor& table);

}  // namespace fieldgraft
