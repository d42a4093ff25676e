#include "vdb_export/content_edge.h"

#include <algorithm>

namespace fieldgraft {
namespace {

constexpr int coarse = 128;       // voxels along the box
constexpr double outside = 1e-3;  // of the optical depth, at either end

// How many bins are left of weights (a line of bins) when `outside` of their sum is cut off at either end.
std::int64_t bins_left(const Tensor& weights) {
    const Tensor up_to = weights.cumsum(0);
    const Tensor total = up_to[-1], from = total - up_to + weights;
    return (up_to > outside * total).logical_and(from > outside * total).sum().item<std::int64_t>();
}

}  // namespace

Content content_of(const FieldGeometry& geometry, const VolumeSource& medium, SamplingOptions options) {
    const double box = longest_edge(geometry);
    options.voxel = box / coarse;
    options.supersample = 1;
    VolumeSource uncoloured = medium;
    uncoloured.color = [](const Tensor& p) { return at::zeros({p.size(0), 3}, at::kFloat); };
    const SparseVolume found = sample_volume(geometry, uncoloured, options);
    if (found.origins.size(0) == 0) return {box, 0};
    const Tensor within = at::arange(block_voxels);
    const Tensor of_voxel[3] = {within.div(64, "floor"), within.div(8, "floor").remainder(8), within.remainder(8)};
    std::int64_t most = 0;
    for (int a = 0; a < 3; ++a) {
        const Tensor bin = found.origins.select(1, a).unsqueeze(1) + of_voxel[a];  // B×512
        most = std::max(most, bins_left(at::bincount(bin.flatten(), found.density.to(at::kDouble).flatten())));
    }
    const std::int64_t held = found.density.gt(0).sum().item<std::int64_t>();
    return {std::min(static_cast<double>(most) * options.voxel, box), held};
}

double content_edge(const FieldGeometry& geometry, const VolumeSource& medium, SamplingOptions options) {
    return content_of(geometry, medium, options).edge;
}

}  // namespace fieldgraft
