#include "core/edit/volume_cells.h"

#include <stdexcept>

#include "core/base/errors.h"
#include "core/edit/vote_grid.h"

namespace fieldgraft {

Tensor cells_above(const FieldGeometry& geometry, const Tensor& region, double width) {
    const int resolution = static_cast<int>(region.size(0));
    const Tensor centres = cell_centres(geometry, resolution);
    const Tensor in_region = region.reshape(-1).to(at::kBool);
    if (!in_region.any().item<bool>()) throw std::invalid_argument("cells_above: the region is empty");
    const Tensor up = at::tensor({geometry.up[0], geometry.up[1], geometry.up[2]}, at::kFloat);
    const Tensor axis = up / up.norm();
    const Tensor height = centres.matmul(axis), flat = centres - height.unsqueeze(1) * axis;
    const Tensor heights = height.masked_select(in_region), spread = flat.index({in_region});
    const float top = heights.max().item<float>(), bottom = heights.min().item<float>();
    // The middle of the topmost tenth, and the region's width at right angles to `up`.
    const Tensor upper = in_region.logical_and(height > top - 0.1f * (top - bottom) - 1e-6f);
    const Tensor middle = flat.index({upper}).mean(0);
    const float extent = (spread.amax(0) - spread.amin(0)).max().item<float>();
    const float radius = static_cast<float>(width) / 2 * extent;
    const Tensor near_axis = (flat - middle).norm(2, {1}) <= radius;
    const Tensor cells =
        near_axis.logical_and(height >= top - 0.2f * radius).logical_and(height <= top + 1.8f * radius);
    return cells.reshape({resolution, resolution, resolution}).to(at::kByte);
}

}  // namespace fieldgraft
