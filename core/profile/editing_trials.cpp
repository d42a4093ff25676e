#include <cmath>

#include "core/edit/metrics.h"
#include "core/edit/patch_source.h"
#include "core/profile/pictures.h"
#include "core/profile/sweeps.h"

namespace fieldgraft {
namespace {

// What all trials are compared with: the views before the edit, and where in them the edit belongs.
class JudgedViews {
  public:
    explicit JudgedViews(const EditingInputs& inputs) : inputs_(inputs) {}

    EditMetrics measure(const EditFile& edit, const Reporter& reporter) {
        if (views_.empty()) prepare(reporter);
        EditStack stack;
        for (const EditFile& below : inputs_.base.stack) stack.push_back(stack_item(below));
        stack.push_back(stack_item(edit));
        const TimedPictures drawn = draw_views(*inputs_.base.field, stack, cameras_, {});
        for (std::size_t i = 0; i < views_.size(); ++i) views_[i].edited = drawn.pictures[i];
        return measure_edit(views_, inputs_.judge.get(), inputs_.spec.source, inputs_.spec.target);
    }

  private:
    void prepare(const Reporter& reporter) {
        const BaseMedium base(inputs_.base.field, inputs_.base.stack);
        const EditPlan plan = EditPlan::compile(inputs_.spec);
        const EditCameras training(base.geometry(), inputs_.spec, inputs_.base.scene);
        const auto guide = inputs_.guides.front().second();
        const EditRegion region = find_region(base, *guide, inputs_.spec, plan, training, inputs_.base.scene, reporter);
        const PatchSource source(base, training, inputs_.spec, plan, region, *guide);
        EditStack stack;
        for (const EditFile& below : inputs_.base.stack) stack.push_back(stack_item(below));
        for (const Camera& camera : inputs_.cameras) {
            const int size = std::min(camera.width, camera.height);
            const FrozenPatch patch = source.view(camera, size);
            cameras_.push_back(square(camera, size));
            EditedView view;
            view.original = draw_views(*inputs_.base.field, stack, {cameras_.back()}, {}).pictures.front();
            view.object = patch.opacity.view({size, size}) > 0.5;
            if (!plan.segmenter_per_view) view.region = patch.masks.positive;
            views_.push_back(std::move(view));
        }
    }

    const EditingInputs inputs_;
    std::vector<Camera> cameras_;
    std::vector<EditedView> views_;
};

int usual_iterations(const EditSpec& spec) {
    return spec.planned_iterations() > 0 ? spec.planned_iterations() : spec.nominal_iterations;
}

class EditingTrials {
  public:
    explicit EditingTrials(const EditingInputs& inputs)
        : inputs_(inputs), views_(std::make_shared<JudgedViews>(inputs)) {
        // The edit was trained for minutes or a number of steps; here the steps are what is compared.
        inputs_.spec.iterations = usual_iterations(inputs.spec);
        inputs_.spec.minutes = 0;
    }

    template <class Change>
    void add(const std::string& knob, const std::string& value, Change change, bool usual = false,
             std::size_t guide = 0) {
        EditSpec spec = inputs_.spec;
        change(spec);
        list.push_back({"editing", knob, value, usual, 1,
                        [inputs = inputs_, views = views_, spec, guide](const Reporter& reporter) {
                            return run(inputs, *views, spec, guide, reporter);
                        }});
    }
    const EditSpec& usual() const { return inputs_.spec; }
    std::vector<Trial> list;

  private:
    static Json run(const EditingInputs& inputs, JudgedViews& views, const EditSpec& spec, std::size_t guide,
                    const Reporter& reporter) {
        EditInputs edit = inputs.base;
        edit.guide = inputs.guides.at(guide).second();
        const EditResult result = train_edit(edit, spec, {}, reporter);
        Json figures = views.measure(result.edit, reporter).to_json();
        figures["seconds"] = result.report.seconds;
        figures["field_seconds"] = result.report.field_seconds_per_iteration * result.report.iterations;
        figures["iterations"] = result.report.iterations;
        return figures;
    }

    EditingInputs inputs_;
    std::shared_ptr<JudgedViews> views_;
};

}  // namespace

std::vector<Trial> editing_trials(const EditingInputs& inputs) {
    EditingTrials trials(inputs);
    const EditSpec usual = trials.usual();
    const int iterations = usual.iterations;
    trials.add(
        "iterations", std::to_string(iterations), [](EditSpec&) {}, true);
    for (const double share : {0.125, 0.25, 0.5, 2.0}) {
        const int some = std::max(1, static_cast<int>(std::lround(share * iterations)));
        trials.add("iterations", std::to_string(some), [&](EditSpec& s) { s.iterations = some; });
    }
    const FieldGeometry& geometry = inputs.base.field->geometry();
    const int largest = std::min(geometry.image_width, geometry.image_height);
    for (const int patch : {32, 48, 72, 96, 128, 160}) {
        if (patch == usual.patch || patch > largest) continue;
        trials.add("patch, pixels an edge", std::to_string(patch), [&](EditSpec& s) { s.patch = patch; });
    }
    for (const int count : {2, 4, 8, 12, 16, 24}) {
        if (count == usual.augmentations) continue;
        trials.add("augmented images", std::to_string(count), [&](EditSpec& s) { s.augmentations = count; });
    }
    if (usual.region_fusion == RegionFusion::fused && usual.region_source != RegionSource::masks) {
        for (const int views : {4, 8, 40}) {
            trials.add("segmenter's views", std::to_string(views), [&](EditSpec& s) { s.region_views = views; });
        }
        trials.add("segmenter's views", "every step", [](EditSpec& s) {
            s.region_fusion = RegionFusion::view;
            s.confine = false;
            s.camera_pool = 0;  // a picture that is kept keeps its mask
        });
    }
    for (std::size_t guide = 1; guide < inputs.guides.size(); ++guide) {
        trials.add(
            "guide", inputs.guides[guide].first, [](EditSpec&) {}, false, guide);
    }
    for (const auto& [share, patch] : {std::pair{0.25, 48}, {0.25, 32}, {0.5, 48}, {2.0, 96}}) {
        if (patch > largest) continue;
        const int some = std::max(1, static_cast<int>(std::lround(share * iterations)));
        trials.add("iterations × patch", fmt::format("{} × {}", some, patch), [&](EditSpec& s) {
            s.iterations = some;
            s.patch = patch;
        });
    }
    return trials.list;
}

}  // namespace fieldgraft
