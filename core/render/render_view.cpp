#include "core/render/render_view.h"

#include "core/base/errors.h"
#include "core/render/blend.h"

namespace fieldgraft {

RenderedRays render_rays(const RadianceField& field, const RayBundle& rays, const RenderOptions& options) {
    at::NoGradGuard no_grad;
    if (options.chunk_rays < 1) {
        throw std::invalid_argument(fmt::format("chunk_rays must be positive, not {}", options.chunk_rays));
    }
    const std::int64_t count = rays.size();
    RenderedRays out{at::empty({count, 3}, at::kFloat), at::empty({count}, at::kFloat), at::empty({count}, at::kFloat)};
    for (std::int64_t first = 0; first < count; first += options.chunk_rays) {
        const std::int64_t n = std::min(options.chunk_rays, count - first);
        const RayBundle chunk{rays.origins.narrow(0, first, n), rays.directions.narrow(0, first, n)};
        const VisibleSamples visible = sample_visible(field, chunk, options.march);
        const Samples& samples = visible.samples;
        const Tensor color = field.color(visible.features, chunk.directions.index_select(0, samples.ray));
        const CompositeOut view = composite(samples.start, samples.delta, samples.t, visible.density, color);
        out.color.narrow(0, first, n).copy_(view.color);
        out.alpha.narrow(0, first, n).copy_(1 - view.transmittance);
        out.depth.narrow(0, first, n).copy_(view.depth);
    }
    return out;
}

RenderedView render_view(const RadianceField& field, const RayBundle& rays, int height, int width,
                         const RenderOptions& options) {
    if (height < 1 || width < 1 || rays.size() != static_cast<std::int64_t>(height) * width) {
        throw std::invalid_argument(fmt::format("{} rays are not a view of {}×{} pixels", rays.size(), width, height));
    }
    const RenderedRays flat = render_rays(field, rays, options);
    return {flat.color.view({height, width, 3}), flat.alpha.view({height, width}), flat.depth.view({height, width})};
}

Tensor over_background_color(const Tensor& color, const Tensor& alpha, const std::array<float, 3>& background) {
    const Tensor behind = torch::tensor({background[0], background[1], background[2]}, color.options());
    return color + (1 - alpha).unsqueeze(-1) * behind;
}

}  // namespace fieldgraft
