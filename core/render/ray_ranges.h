// A bundle of rays shared out among threads, range by range, as the kernels take them.
#pragma once

#include <algorithm>

#include "core/base/spans.h"
#include "core/field/torch_parallel.h"
#include "core/render/march.h"
#include "core/render/ray_pass.h"

namespace fieldgraft {

// Calls body(RayRange) for ranges that make up all rays, each on one thread. Throws std::invalid_argument: check_rays,
// check_transmittance, march_step.
template <class Body>
void over_ray_ranges(const RadianceField& field, const RayBundle& rays, const MarchOptions& options, Body body) {
    check_rays(rays);
    check_transmittance(options);
    const std::int64_t count = rays.size();
    const Tensor origins = rays.origins.contiguous(), directions = rays.directions.contiguous();
    const Tensor jitter = draw_jitter(options.jitter, count);
    const MarchRays march{values(origins), values(directions),
                          jitter.defined() ? values(jitter) : std::span<const float>(),
                          march_step(field.geometry(), options), options.near};
    share_out((count + rays_a_range - 1) / rays_a_range, [&](std::int64_t i) {
        const std::int64_t first = i * rays_a_range, last = std::min(first + rays_a_range, count);
        body(RayRange{march, first, last, options.min_transmittance});
    });
}

}  // namespace fieldgraft
