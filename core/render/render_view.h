// Pictures of the plain field: the samples that can be seen, their colours, composited; no gradients.
//
// Rays R×3 in model coordinates. Colours are premultiplied by alpha and carry no background: over_background_color adds
// it, C + (1 − alpha)·background. alpha = 1 − transmittance past the last visible sample; depth along the ray, model
// units, Σ w t / Σ w (0 where nothing is hit). Rays are worked through in chunks; the result does not depend on them.
// What lies behind transmittance march.min_transmittance is left out: a colour error of at most that.
#pragma once

#include <array>

#include "core/render/march.h"

namespace fieldgraft {

struct RenderOptions {
    MarchOptions march;
    std::int64_t chunk_rays = 4096;
};

struct RenderedRays {
    Tensor color;  // R×3
    Tensor alpha;  // R
    Tensor depth;  // R
};
RenderedRays render_rays(const RadianceField& field, const RayBundle& rays, const RenderOptions& options = {});

// What render_rays would ask of the field: densities of samples it looks at, colours of those that are visible.
struct SampleCounts {
    std::int64_t looked_at = 0, visible = 0;
};
SampleCounts count_samples(const RadianceField& field, const RayBundle& rays, const RenderOptions& options = {});

struct RenderedView {
    Tensor color;  // H×W×3, premultiplied
    Tensor alpha;  // H×W
    Tensor depth;  // H×W
};
// `rays` are all rays of the view, row by row: height·width of them.
RenderedView render_view(const RadianceField& field, const RayBundle& rays, int height, int width,
                         const RenderOptions& options = {});

// color …×3 and alpha … → …×3 in front of one colour.
Tensor over_background_color(const Tensor& color, const Tensor& alpha, const std::array<double, 3>& background);

}  // namespace fieldgraft
