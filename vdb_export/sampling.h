// Sampling a medium (density and view-independent colour) into 8³ blocks of voxels over a field's box.
//
// Voxel (x, y, z) has its centre at box_min + (index + ½)·h in model coordinates, h = voxel edge; index_to_world
// applies the inverse of the geometry's frame, and densities are multiplied by the frame's scale: σ·length is the same
// in both.
//
// Where blocks are looked at: those that touch an occupied cell of one of the grids (R×R×R uint8, z, y, x order, over
// the box) and hold something at their voxels' centres. A voxel's density is the mean over s³ sub-samples of min(σ,
// cap/h): renderers interpolate linearly between voxels, and an uncapped hard surface next to 0 would swell by up to a
// voxel. With cap = 5.5 the half-transparent point of an interpolated edge lies midway between an empty and a full
// voxel (∫₀ᵘ cap·t dt = ln 2 at u = ½), which is right for one straight edge; of trained fields, whose parts are a few
// voxels thin, Cycles' picture came nearer to ours with 2 and without sub-samples, which swell thin parts less. Colour
// is taken at the density-weighted centre of the sub-samples. Voxels with σ·h below the threshold are 0.
//
// Memory: one chunk of blocks at a time beside what is kept.
#pragma once

#include <functional>
#include <vector>

#include "core/base/progress.h"
#include "core/field/geometry.h"
#include "vdb_export/sparse_volume.h"

namespace fieldgraft {

struct VolumeSource {
    std::function<Tensor(const Tensor&)> density;  // positions N×3 (model) → N, ≥ 0, per model unit
    std::function<Tensor(const Tensor&)> color;    // positions N×3 (model) → N×3 in [0, 1]
    std::vector<Tensor> occupancy;                 // cells where there may be density; none: the whole box
};

struct SamplingOptions {
    double voxel = 0;              // edge in model units
    double threshold = 0.02;       // smallest optical depth σ·h that is kept
    double max_optical_depth = 2;  // cap; 0: none
    int supersample = 1;           // s
    std::int64_t chunk_positions = 1 << 18;
};

// The voxels along each axis that cover the box.
std::array<std::int64_t, 3> voxel_counts(const FieldGeometry& geometry, double voxel);

// Scale of the frame's rotation-and-scale part. Throws std::invalid_argument when the frame is not a similarity.
double frame_scale(const FieldGeometry& geometry);

// Blocks with at least one voxel above the threshold (maybe none). Throws Cancelled when the reporter asks to stop.
SparseVolume sample_volume(const FieldGeometry& geometry, const VolumeSource& medium, const SamplingOptions& options,
                           const Reporter& reporter = {});

}  // namespace fieldgraft
