// Baking a field, with edits over it, into an OpenVDB file that a volume renderer shows as the field.
//
// Sampled is the blended medium of the whole stack: σᵝ = (1 − βσ) σᵒ + σᵉ and the conserving mixture c = Σσc / Σσ of
// its parts (Blending-NeRF, eq. 4–5; each edit sees what lies below it as one medium), strengths scaling σᵉ, βσ, βc.
// The colour is view-independent: diffuse_color() of the field, because a volume shader cannot show any other;
// renderers of ours can be given the same (BlendedOptions::color). See sampling.h for voxels, thresholds and the
// transform to the user's world, sparse_volume.h for the file. Not differentiable.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/progress.h"
#include "core/field/edit_field.h"
#include "core/field/radiance_field.h"

namespace fieldgraft {

struct BakeOptions {
    int resolution = 256;   // voxels along the longest edge of what there is (content_edge), 8 … 2048
    double voxel_size = 0;  // edge in the user's world; > 0: in place of the resolution
    // The smallest optical depth that is kept, of a 256th of the longest edge of what there is: of a voxel at the usual
    // resolution, and as little density at every other.
    double threshold = 0.02;
    double max_optical_depth = 2;  // cap of a voxel's optical depth; 0: none
    int supersample = 1;           // density sub-samples along each axis of a voxel
    int color_dilation = 2;        // voxels around active ones that get a colour
    bool half_precision = true;
    std::map<std::string, std::string> metadata{};  // into the file, beside what bake() writes itself
};

struct BakeReport {
    std::int64_t voxels = 0;
    std::uintmax_t bytes = 0;
    double seconds = 0;
    double voxel_size = 0;  // user's world
    bool half_precision = false;
};

// edits: bottom of the stack first. Events: progress. Throws InputError (options out of range, a voxel size that is too
// small for the box), Failure (nothing above the threshold; the file cannot be written), Cancelled.
BakeReport bake(const RadianceField& field, const std::vector<EditFile>& edits, const std::filesystem::path& path,
                const BakeOptions& options = {}, const Reporter& reporter = {});

}  // namespace fieldgraft
