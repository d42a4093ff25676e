// Pictures of a baked file as a volume renderer shows it: density and colour interpolated linearly between voxels and
// integrated along rays, the same integral as Cycles' (docs/decisions.md). What a bake loses, without starting Blender.
//
// Rays in model coordinates; the file's transform and the geometry's frame take them to its voxels. Nothing here is
// differentiable.
#pragma once

#include <filesystem>

#include "core/field/geometry.h"
#include "core/render/render_view.h"

namespace fieldgraft {

struct GridViewOptions {
    double step = 0.5;  // of a voxel
    double min_transmittance = 1e-4;
};

// Premultiplied colours and alphas of the rays; depth in model units. Throws InputError as read_vdb does.
RenderedRays render_grids(const std::filesystem::path& path, const FieldGeometry& geometry, const RayBundle& rays,
                          const GridViewOptions& options = {});

}  // namespace fieldgraft
