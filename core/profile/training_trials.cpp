#include "core/base/image.h"
#include "core/profile/pictures.h"
#include "core/profile/sweeps.h"
#include "core/train/trainer.h"

namespace fieldgraft {
namespace {

// What all trials share: the images as training reads them, the test views, and how far the usual setting gets.
class TrainingRuns {
  public:
    explicit TrainingRuns(const TrainingInputs& inputs) : inputs_(inputs), data_(training_data_of(*inputs.scene)) {
        for (const View& view : inputs.views) {
            cameras_.push_back(view.camera);
            expected_.push_back(over_background(inputs.scene->image(view), torch::ones({3})));
        }
    }

    Json by_time(TrainOptions options, double minutes, const Reporter& reporter) const {
        options.minutes = minutes;
        return fit(options, reporter);
    }

    // As many iterations as the usual setting makes in its time.
    Json by_iterations(TrainOptions options, const Reporter& reporter) {
        if (iterations_ == 0) {
            TrainOptions usual;
            usual.seed = inputs_.seed;
            iterations_ = by_time(usual, inputs_.minutes, reporter).at("iterations").get<std::int64_t>();
        }
        options.iterations = iterations_;
        return fit(options, reporter);
    }

    // The usual setting's networks and table, for knobs to start from.
    HashFieldConfig usual_config() const {
        TrainOptions usual;
        usual.minutes = inputs_.minutes;
        return usual.field_config();
    }
    double minutes() const { return inputs_.minutes; }
    void note_iterations(const Json& usual) { iterations_ = usual.at("iterations").get<std::int64_t>(); }

  private:
    Json fit(TrainOptions options, const Reporter& reporter) const {
        options.seed = inputs_.seed;
        const TrainResult result = train_field(data_, options, reporter);
        const TimedPictures drawn = draw_views(*result.field, {}, cameras_, {});
        return {{"seconds", result.report.seconds},  {"iterations", result.report.iterations},
                {"samples", result.report.samples},  {"psnr", mean_psnr(drawn.pictures, expected_)},
                {"seconds_per_view", drawn.seconds}, {"peak_mib", result.report.peak_mib}};
    }

    const TrainingInputs inputs_;
    const TrainingData data_;
    std::vector<Camera> cameras_;
    std::vector<Tensor> expected_;
    std::int64_t iterations_ = 0;
};

}  // namespace

std::vector<Trial> training_trials(const TrainingInputs& inputs) {
    const auto runs = std::make_shared<TrainingRuns>(inputs);
    const HashFieldConfig usual = runs->usual_config();
    std::vector<Trial> trials;
    trials.push_back(
        {"training", "minutes", fmt::format("{:g}", inputs.minutes), true, 1, [runs](const Reporter& reporter) {
             const Json figures = runs->by_time({}, runs->minutes(), reporter);
             runs->note_iterations(figures);
             return figures;
         }});
    for (const double share : {0.25, 0.5, 2.0}) {
        trials.push_back({"training", "minutes", fmt::format("{:g}", share * inputs.minutes), false, 1,
                          [runs, share](const Reporter& reporter) {
                              TrainOptions options;
                              options.field = runs->usual_config();
                              return runs->by_time(options, share * runs->minutes(), reporter);
                          }});
    }
    const auto add = [&](const std::string& knob, const std::string& value, const auto& change) {
        TrainOptions options;
        options.field = usual;
        change(options);
        trials.push_back({"training", knob, value, false, 1, [runs, options](const Reporter& reporter) {
                              return runs->by_iterations(options, reporter);
                          }});
    };
    for (const int log2 : {14, 15, 16, 17, 18, 19}) {
        if (log2 == usual.log2_table_size) continue;
        add("table entries a level, log₂", std::to_string(log2),
            [&](TrainOptions& o) { o.field->log2_table_size = log2; });
    }
    for (const int levels : {4, 6, 8, 12}) {
        if (levels == usual.levels) continue;
        add("levels", std::to_string(levels), [&](TrainOptions& o) { o.field->levels = levels; });
    }
    add("levels × features", "16 × 2", [](TrainOptions& o) {
        o.field->levels = 16;
        o.field->features_per_level = 2;
    });
    for (const int width : {16, 32, 64, 128}) {
        if (width == usual.color_hidden) continue;
        add("network width", std::to_string(width), [&](TrainOptions& o) {
            o.field->density_hidden = width;
            o.field->color_hidden = width;
        });
    }
    double square = 0;
    for (int c = 0; c < 3; ++c) {
        const Bounds& box = inputs.scene->bounds();
        square += std::pow(box.max[c] - box.min[c], 2);
    }
    for (const int steps : {256, 512, 2048}) {
        add("step, of the diagonal", fmt::format("1/{}", steps),
            [&](TrainOptions& o) { o.step = std::sqrt(square) / steps; });
    }
    for (const int log2 : {13, 14, 16}) {
        add("samples an iteration, log₂", std::to_string(log2), [&](TrainOptions& o) { o.samples = 1ll << log2; });
    }
    add("precision", "float32", [](TrainOptions& o) { o.precision = "float32"; });
    for (const auto& [log2, width] : {std::pair{14, 16}, {15, 16}, {18, 64}, {19, 64}}) {
        add("table × width", fmt::format("{} × {}", log2, width), [&](TrainOptions& o) {
            o.field->log2_table_size = log2;
            o.field->density_hidden = width;
            o.field->color_hidden = width;
        });
    }
    return trials;
}

}  // namespace fieldgraft
