#include "core/train/fit_batch.h"

#include <algorithm>

#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "core/render/march.h"

namespace fieldgraft {
namespace {

// Where a ray ends in training: ten times what drawing leaves unseen, still far below the error of any fit, for a
// fourth fewer samples inside what is opaque.
constexpr double min_transmittance = 1e-3;

}  // namespace

std::vector<RangeFit> fit_batch(const RadianceField& field, const MarchGrid& cells, const RayBatch& batch,
                                const BatchOptions& options, Random& random) {
    at::NoGradGuard no_grad;
    const Tensor origins = batch.rays.origins.contiguous(), directions = batch.rays.directions.contiguous();
    const Tensor jitter = draw_jitter(&random, batch.rays.size());
    const MarchRays rays{values(origins), values(directions), values(jitter), options.step, options.near};
    const KernelField kernel(field, options.precision);
    const std::int64_t total = batch.rays.size(), a_range = std::clamp<std::int64_t>(total / 16, 32, rays_a_range);
    const std::int64_t count = (total + a_range - 1) / a_range;
    std::vector<RangeFit> fits;
    for (std::int64_t i = 0; i < count; ++i) fits.emplace_back(kernel.weights.shape());
    share_out(count, [&](std::int64_t i) {
        const RayRange range{rays, i * a_range, std::min((i + 1) * a_range, total), min_transmittance};
        fit_range(kernel, cells, range, values(batch.colors), options.background, fits[i]);
    });
    return fits;
}

}  // namespace fieldgraft
