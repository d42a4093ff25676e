#include "core/render/render_view.h"

#include <atomic>

#include "core/base/errors.h"
#include "core/base/spans.h"
#include "core/render/ray_ranges.h"

namespace fieldgraft {
namespace {

// body(field, cells, rays) for ranges of the rays, each on one thread.
template <class Body>
void over_ranges(const RadianceField& field, const RayBundle& rays, const RenderOptions& options, Body body) {
    if (options.chunk_rays < 1) {
        throw std::invalid_argument(fmt::format("chunk_rays must be positive, not {}", options.chunk_rays));
    }
    const KernelField kernel(field);
    const MarchGrid cells = march_grid_of(field.geometry(), field.occupancy());
    over_ray_ranges(field, rays, options.march, [&](const RayRange& range) { body(kernel, cells, range); });
}

}  // namespace

RenderedRays render_rays(const RadianceField& field, const RayBundle& rays, const RenderOptions& options) {
    at::NoGradGuard no_grad;
    const std::int64_t count = rays.size();
    RenderedRays out{at::empty({count, 3}, at::kFloat), at::empty({count}, at::kFloat), at::empty({count}, at::kFloat)};
    const Tensor transmittance = at::empty({count}, at::kFloat);
    over_ranges(field, rays, options, [&](const KernelField& kernel, const MarchGrid& cells, const RayRange& range) {
        draw_range(kernel, cells, range, mutable_values(out.color), mutable_values(transmittance),
                   mutable_values(out.depth));
    });
    at::sub_out(out.alpha, at::ones_like(transmittance), transmittance);
    return out;
}

SampleCounts count_samples(const RadianceField& field, const RayBundle& rays, const RenderOptions& options) {
    std::atomic<std::int64_t> looked_at{0}, visible{0};
    over_ranges(field, rays, options, [&](const KernelField& kernel, const MarchGrid& cells, const RayRange& range) {
        const VisibleRays found(kernel, cells, range, VisibleRays::Encoded::dropped);
        looked_at += static_cast<std::int64_t>(found.looked_at());
        visible += static_cast<std::int64_t>(found.samples());
    });
    return {looked_at, visible};
}

RenderedView render_view(const RadianceField& field, const RayBundle& rays, int height, int width,
                         const RenderOptions& options) {
    if (height < 1 || width < 1 || rays.size() != static_cast<std::int64_t>(height) * width) {
        throw std::invalid_argument(fmt::format("{} rays are not a view of {}×{} pixels", rays.size(), width, height));
    }
    const RenderedRays flat = render_rays(field, rays, options);
    return {flat.color.view({height, width, 3}), flat.alpha.view({height, width}), flat.depth.view({height, width})};
}

Tensor over_background_color(const Tensor& color, const Tensor& alpha, const std::array<double, 3>& background) {
    const Tensor behind = torch::tensor({background[0], background[1], background[2]}, color.options());
    return color + (1 - alpha).unsqueeze(-1) * behind;
}

}  // namespace fieldgraft
