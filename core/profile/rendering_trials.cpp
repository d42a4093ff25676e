#include "core/base/image.h"
#include "core/field/cells.h"
#include "core/profile/pictures.h"
#include "core/profile/sweeps.h"

namespace fieldgraft {
namespace {

struct Setting {
    int steps = 1024;  // of the box's diagonal
    double min_transmittance = 1e-4;
    int occupancy = 0;  // cells an edge; 0: the field's own
    double scale = 1;
    Compositing compositing = Compositing::paper;
};

// The cameras' pictures as good as they get, drawn when they are first asked for.
class ConvergedPictures {
  public:
    explicit ConvergedPictures(const RenderingInputs& inputs) : inputs_(inputs) {}
    const std::vector<Tensor>& pictures();

  private:
    const RenderingInputs inputs_;
    std::vector<Tensor> pictures_;
};

double diagonal(const FieldGeometry& geometry) {
    double square = 0;
    for (int c = 0; c < 3; ++c) square += std::pow(geometry.box_max[c] - geometry.box_min[c], 2);
    return std::sqrt(square);
}

TimedPictures draw(const RenderingInputs& inputs, const Setting& setting) {
    BlendedOptions options;
    options.render.march.step = diagonal(inputs.field->geometry()) / setting.steps;
    options.render.march.min_transmittance = setting.min_transmittance;
    options.blend.compositing = setting.compositing;
    options.blend.removed = RemovedMap::visible;
    if (setting.occupancy == 0) return draw_views(*inputs.field, inputs.stack, inputs.cameras, options, setting.scale);
    RadianceField other(*inputs.field);  // shares the tables
    other.set_occupancy(resampled_cells(inputs.field->occupancy(), setting.occupancy));
    return draw_views(other, inputs.stack, inputs.cameras, options, setting.scale);
}

const std::vector<Tensor>& ConvergedPictures::pictures() {
    if (pictures_.empty()) {
        Setting converged;
        converged.steps = 8 * converged.steps;
        converged.min_transmittance = 1e-7;
        converged.compositing = Compositing::conserving;
        pictures_ = draw(inputs_, converged).pictures;
    }
    return pictures_;
}

class RenderingTrials {
  public:
    explicit RenderingTrials(const RenderingInputs& inputs)
        : inputs_(inputs), reference_(std::make_shared<ConvergedPictures>(inputs)) {}

    void add(const std::string& knob, const std::string& value, const Setting& setting, bool usual = false) {
        list.push_back({"rendering", knob, value, usual, inputs_.repeats,
                        [inputs = inputs_, reference = reference_, setting](const Reporter&) -> Json {
                            const auto& expected = reference->pictures();
                            TimedPictures drawn = draw(inputs, setting);
                            for (std::size_t i = 0; i < drawn.pictures.size(); ++i) {
                                const Tensor& full = expected[i];
                                if (drawn.pictures[i].sizes() == full.sizes()) continue;
                                drawn.pictures[i] = resize_image(drawn.pictures[i], static_cast<int>(full.size(0)),
                                                                 static_cast<int>(full.size(1)));
                            }
                            return {{"seconds", drawn.seconds}, {"psnr", mean_psnr(drawn.pictures, expected)}};
                        }});
    }
    std::vector<Trial> list;

  private:
    const RenderingInputs inputs_;
    const std::shared_ptr<ConvergedPictures> reference_;
};

std::string step_name(int steps) {
    return fmt::format("1/{}", steps);
}

}  // namespace

std::vector<Trial> rendering_trials(const RenderingInputs& inputs) {
    RenderingTrials trials(inputs);
    const Setting usual;
    trials.add("step, of the diagonal", step_name(usual.steps), usual, true);
    for (const int steps : {128, 256, 512, 2048, 4096}) {
        Setting setting;
        setting.steps = steps;
        trials.add("step, of the diagonal", step_name(steps), setting);
    }
    for (const double least : {0.3, 0.1, 0.03, 1e-2, 1e-3, 1e-5}) {
        Setting setting;
        setting.min_transmittance = least;
        trials.add("ends at transmittance", fmt::format("{:g}", least), setting);
    }
    if (inputs.field->occupancy().defined()) {
        for (const int cells : {16, 32, 64}) {
            if (cells >= inputs.field->occupancy().size(0)) continue;
            Setting setting;
            setting.occupancy = cells;
            trials.add("occupancy, cells an edge", std::to_string(cells), setting);
        }
    }
    for (const double scale : {0.25, 0.5, 0.75}) {
        Setting setting;
        setting.scale = scale;
        trials.add("picture scale", fmt::format("{:g}", scale), setting);
    }
    for (const auto& [steps, least] : {std::pair{512, 0.01}, {512, 0.03}, {256, 0.01}, {256, 0.03}, {2048, 1e-3}}) {
        Setting setting;
        setting.steps = steps;
        setting.min_transmittance = least;
        trials.add("step × transmittance", fmt::format("{} × {:g}", step_name(steps), least), setting);
    }
    // Without an edit the two rules are one.
    if (!inputs.stack.empty()) {
        for (const int steps : {128, 256, 512, 1024, 2048}) {
            Setting setting;
            setting.steps = steps;
            setting.compositing = Compositing::conserving;
            trials.add("step, conserving", step_name(steps), setting);
        }
    }
    return trials.list;
}

}  // namespace fieldgraft
