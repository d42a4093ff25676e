#include "vdb_export/vdb_export.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "vdb_export/content_edge.h"
#include "vdb_export/volume_source.h"

namespace fieldgraft {
namespace {

constexpr int least_resolution = 8, greatest_resolution = 2048;
constexpr int threshold_parts = 256;  // of the thing's edge: BakeOptions::threshold

// The voxel's edge in model units; `content` is the edge of what there is (see content_edge).
double model_voxel(const FieldGeometry& geometry, const BakeOptions& options, double content) {
    const double longest = longest_edge(geometry), scale = frame_scale(geometry);
    if (options.voxel_size > 0) {
        const double voxel = options.voxel_size * scale;
        if (longest / voxel > greatest_resolution || longest / voxel < least_resolution) {
            input_error(
                "voxel size {} gives {:.0f} voxels along the box's longest edge ({:.4g} long): choose {:.3g} to {:.3g}",
                options.voxel_size, longest / voxel, longest / scale, longest / scale / greatest_resolution,
                longest / scale / least_resolution);
        }
        return voxel;
    }
    if (options.resolution < least_resolution || options.resolution > greatest_resolution) {
        input_error("bake resolution {}: choose {} to {} voxels", options.resolution, least_resolution,
                    greatest_resolution);
    }
    // A small thing in a huge box does not ask for more voxels than a grid may have.
    return std::max(content / options.resolution, longest / greatest_resolution);
}

void check(const BakeOptions& options) {
    if (!(options.voxel_size >= 0)) input_error("bake voxel size {}: it must be positive", options.voxel_size);
    if (!(options.threshold >= 0)) input_error("bake threshold {}: it must not be negative", options.threshold);
    if (options.supersample < 1 || options.supersample > 8) {
        input_error("bake supersampling {}: choose 1 to 8", options.supersample);
    }
    if (!(options.max_optical_depth >= 0)) {
        input_error("bake optical depth cap {}: it must not be negative (0: none)", options.max_optical_depth);
    }
    if (options.color_dilation < 0 || options.color_dilation > 64) {
        input_error("bake colour dilation {}: choose 0 to 64 voxels", options.color_dilation);
    }
}

std::string prompts_of(const std::vector<EditFile>& edits) {
    std::string text;
    for (const EditFile& edit : edits) {
        const std::string target = edit.specification.value("target", std::string());
        if (!target.empty()) text += (text.empty() ? "" : "; ") + target;
    }
    return text;
}

std::map<std::string, std::string> description(const RadianceField& field, const std::vector<EditFile>& edits,
                                               const BakeOptions& options, double voxel_size) {
    auto metadata = options.metadata;
    metadata["fieldgraft_field"] = field.hash();
    metadata["fieldgraft_color"] = "view-independent, sRGB-encoded";
    metadata["fieldgraft_density"] = "optical depth per unit of length";
    metadata["fieldgraft_voxel_size"] = fmt::format("{:.9g}", voxel_size);
    if (const std::string prompts = prompts_of(edits); !prompts.empty()) metadata["fieldgraft_prompts"] = prompts;
    return metadata;
}

}  // namespace

BakeReport bake(const RadianceField& field, const std::vector<EditFile>& edits, const std::filesystem::path& path,
                const BakeOptions& options, const Reporter& reporter) {
    check(options);
    const Stopwatch watch;
    const FieldGeometry& geometry = field.geometry();
    EditStack stack;
    for (const EditFile& edit : edits) stack.push_back(stack_item(edit));
    const VolumeSource source = volume_source(field, stack);
    SamplingOptions sampling;
    sampling.threshold = options.threshold;
    sampling.max_optical_depth = options.max_optical_depth;
    sampling.supersample = options.supersample;
    const double content = content_edge(geometry, source, sampling);
    sampling.voxel = model_voxel(geometry, options, content);
    // Haze is haze however fine the voxels are: what is kept is a matter of density, not of a voxel's own depth.
    sampling.threshold *= sampling.voxel / (content / threshold_parts);
    const double voxel_size = sampling.voxel / frame_scale(geometry);
    SparseVolume volume = sample_volume(geometry, source, sampling, reporter);
    if (volume.origins.size(0) == 0) {
        failure(
            "{}: nothing to bake, nowhere is the optical depth of 1/{} of the field above {}: is it trained, or is the "
            "threshold too high?",
            path.string(), threshold_parts, options.threshold);
    }
    volume.metadata = description(field, edits, options, voxel_size);
    const VdbFigures figures = write_vdb(path, volume, {options.half_precision, options.color_dilation});
    if (options.half_precision && !figures.half_precision) {
        reporter.warning("densities above 65504 do not fit half floats: the volume is stored in full floats");
    }
    return {figures.voxels, figures.bytes, watch.seconds(), voxel_size, figures.half_precision};
}

}  // namespace fieldgraft
