#include <algorithm>
#include <cmath>

#include "core/field/diffuse_color.h"
#include "core/profile/pictures.h"
#include "core/profile/sweeps.h"
#include "vdb_export/grid_view.h"
#include "vdb_export/vdb_export.h"

namespace fieldgraft {
namespace {

// The field's own pictures with the colour a grid holds, drawn when they are first asked for.
class FieldPictures {
  public:
    explicit FieldPictures(const BakingInputs& inputs) : inputs_(inputs) {}

    const std::vector<Tensor>& pictures() {
        if (pictures_.empty()) {
            EditStack stack;
            for (const EditFile& edit : inputs_.edits) stack.push_back(stack_item(edit));
            BlendedOptions options;
            options.blend.compositing = Compositing::conserving;
            options.blend.removed = RemovedMap::visible;
            options.color = [field = inputs_.field](const Tensor& features, const Tensor&, const Tensor&) {
                return diffuse_color(*field, features);
            };
            pictures_ = draw_views(*inputs_.field, stack, inputs_.cameras, options).pictures;
        }
        return pictures_;
    }

  private:
    const BakingInputs inputs_;
    std::vector<Tensor> pictures_;
};

Json run(const BakingInputs& inputs, FieldPictures& reference, const BakeOptions& options, const Reporter& reporter) {
    const auto& expected = reference.pictures();
    const std::filesystem::path path = inputs.scratch / "trial.vdb";
    const BakeReport report = bake(*inputs.field, inputs.edits, path, options, reporter);
    std::vector<Tensor> pictures;
    for (const Camera& camera : inputs.cameras) {
        const Rays rays = rays_of_view(camera);
        const RenderedRays drawn =
            render_grids(path, inputs.field->geometry(), {rays.origins, rays.directions}, GridViewOptions());
        pictures.push_back(picture_of(inputs.field->geometry(), drawn.color, drawn.alpha, camera));
    }
    std::filesystem::remove(path);
    return {{"seconds", report.seconds},
            {"psnr", mean_psnr(pictures, expected)},
            {"mib", static_cast<double>(report.bytes) / (1 << 20)},
            {"voxels", report.voxels}};
}

}  // namespace

std::vector<Trial> baking_trials(const BakingInputs& inputs) {
    const auto reference = std::make_shared<FieldPictures>(inputs);
    std::vector<Trial> trials;
    const auto add = [&](const std::string& knob, const std::string& value, const BakeOptions& options,
                         bool usual = false) {
        trials.push_back({"baking", knob, value, usual, 1, [inputs, reference, options](const Reporter& reporter) {
                              return run(inputs, *reference, options, reporter);
                          }});
    };
    const auto changed = [&](const auto& change) {
        BakeOptions options;
        options.resolution = inputs.resolution;
        change(options);
        return options;
    };
    add("voxels an edge", std::to_string(inputs.resolution), changed([](BakeOptions&) {}), true);
    for (const double share : {0.25, 0.375, 0.5, 0.75, 1.5, 2.0}) {
        const int resolution = std::clamp(static_cast<int>(std::lround(share * inputs.resolution)), 8, 2048);
        add("voxels an edge", std::to_string(resolution), changed([&](BakeOptions& o) { o.resolution = resolution; }));
    }
    add("precision on disk", "float", changed([](BakeOptions& o) { o.half_precision = false; }));
    for (const double threshold : {0.0, 0.005, 0.1, 0.3}) {
        add("least optical depth kept", fmt::format("{:g}", threshold),
            changed([&](BakeOptions& o) { o.threshold = threshold; }));
    }
    for (const double cap : {0.0, 1.0, 4.0}) {
        add("cap of a voxel's optical depth", cap == 0 ? "none" : fmt::format("{:g}", cap),
            changed([&](BakeOptions& o) { o.max_optical_depth = cap; }));
    }
    add("sub-samples an axis", "2", changed([](BakeOptions& o) { o.supersample = 2; }));
    return trials;
}

}  // namespace fieldgraft
