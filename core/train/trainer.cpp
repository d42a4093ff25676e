#include "core/train/trainer.h"

#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/base/process.h"
#include "core/render/render_view.h"
#include "core/train/checkpoint.h"
#include "core/train/fit_batch.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t refresh_interval = 16;  // iterations between looks at the occupancy

double preset_minutes(const std::string& quality) {
    if (quality == "draft") return 1;
    if (quality == "preview") return 3;
    if (quality == "final") return 10;
    input_error("quality \"{}\" is unknown: draft, preview or final", quality);
}

double psnr_of(double error) {
    return error > 0 ? -10 * std::log10(error) : std::numeric_limits<double>::infinity();
}

// Whether a step had anything to teach: no gradient of any matrix is one of no sample, or of networks that are dead.
bool any_gradient(const std::vector<RangeFit>& fits) {
    const auto alive = [](const std::vector<float>& sums) {
        return std::any_of(sums.begin(), sums.end(), [](float x) { return x != 0; });
    };
    return std::any_of(fits.begin(), fits.end(), [&](const RangeFit& fit) {
        const FieldMlpGradients& g = fit.gradients;
        return alive(g.density1) || alive(g.density0) || alive(g.color2) || alive(g.color1) || alive(g.color0);
    });
}

class Trainer {
  public:
    Trainer(const TrainingData& data, const TrainOptions& options, const Reporter& reporter,
            const std::filesystem::path& checkpoint)
        : data_(data),
          options_(options),
          reporter_(reporter),
          checkpoint_(checkpoint),
          state_(fresh_state()),
          guard_(state_.guard,
                 {[this] { return learnt(state_); }, [this](const auto& good) { put_back(state_, good); }}) {
        refresh_cells();
        guard_.keep(0);
    }

    void resume() {
        load_checkpoint(checkpoint_, state_, run_description());
        refresh_cells();
        guard_.keep(state_.iteration);
        before_ = state_.seconds;
    }

    TrainResult run() {
        last_saved_ = last_told_ = state_.seconds;
        while (share() < 1) {
            iterate();
            state_.seconds = before_ + watch_.seconds();
            if (state_.seconds - last_told_ >= 0.5 || share() >= 1) tell();
            if (reporter_.stop_requested()) {
                save();
                throw Cancelled();
            }
            if (state_.seconds - last_saved_ >= options_.checkpoint_seconds) save();
        }
        return finish();
    }

  private:
    TrainState fresh_state() const {
        auto field = std::make_shared<RadianceField>(options_.field_config(), data_.geometry, options_.seed);
        const Tensor seen =
            seen_cells(data_.geometry, options_.occupancy_resolution, data_.train.cameras, data_.near());
        OccupancyGrid occupancy(data_.geometry, options_.occupancy_resolution, step(), seen);
        field->set_occupancy(occupancy.cells());
        return {field, FieldOptimizer(*field), occupancy, Random(options_.seed, 0x7261696eu)};
    }

    double step() const {
        MarchOptions march;
        march.step = options_.step;
        return march_step(data_.geometry, march);
    }

    // Long steps first: while the picture is rough, more rays teach it more than finer ones do.
    double current_step() const {
        const double done = share();
        return step() * (done < 0.3 ? 4 : done < 0.8 ? 2 : 1);
    }

    // How much of the run is done.
    double share() const {
        if (options_.iterations) {
            return static_cast<double>(state_.iteration) / static_cast<double>(*options_.iterations);
        }
        return state_.seconds / (60 * options_.budget());
    }

    // What the networks are really computed in: another machine may not go on in the same.
    std::string precision_name() const {
        const FieldMlpWeights weights(state_.field->mlp_shape(), options_.network_precision());
        return weights.precision() == Precision::bfloat16 ? "bfloat16" : "float32";
    }

    Json run_description() const {
        return {{"config", options_.field_config().to_json()},
                {"geometry", data_.geometry.to_json()},
                {"seed", options_.seed},
                {"samples", options_.samples},
                {"rate", options_.rate},
                {"rate_end", options_.rate_end},
                {"step", step()},
                {"images", data_.train.cameras.size()},
                {"iterations", options_.iterations ? Json(*options_.iterations) : Json()},
                {"occupancy_resolution", options_.occupancy_resolution},
                {"precision", precision_name()}};
    }

    double rate() const {
        const double done = std::min(share(), 1.0);
        // The first steps are short: Adam's second moments know nothing yet. After 20 of them some small scenes were
        // still lost at this rate.
        const double warm = std::min(1.0, static_cast<double>(state_.iteration + 1) / 64);
        return options_.rate * std::max(options_.rate_end, 1 - done) * warm * state_.guard.scale;
    }

    void refresh_cells() {
        state_.field->set_occupancy(state_.occupancy.cells());
        cells_ = march_grid_of(data_.geometry, state_.field->occupancy());
    }

    void refresh_occupancy() {
        const std::int64_t i = state_.iteration;
        if (i == 0 || i % refresh_interval != 0) return;
        // All of it at first, when everything changes, then less and less often.
        if (i == 16 || i == 64 || i == 256 || i == 1024) {
            state_.occupancy.refresh_all(*state_.field, state_.random);
        } else {
            state_.occupancy.refresh_some(*state_.field, state_.random);
        }
        refresh_cells();
    }

    void iterate() {
        refresh_occupancy();
        const RayBatch batch = draw_rays(data_.images_at(state_.iteration), state_.rays, state_.random);
        const BatchOptions how{options_.network_precision(), current_step(), data_.near(), data_.background};
        const std::vector<RangeFit> fits = fit_batch(*state_.field, cells_, batch, how, state_.random);
        double error = 0;
        std::int64_t samples = 0;
        for (const RangeFit& part : fits) {
            error += part.squared_error / static_cast<double>(3 * batch.rays.size());
            samples += static_cast<std::int64_t>(part.samples);
        }
        const bool good = std::isfinite(error) && state_.optimizer.step(*state_.field, rate(), fits);
        judge(guard_.after_step(good, error, state_.iteration, !any_gradient(fits)));
        adapt_rays(samples);
        state_.samples += samples;
        ++state_.iteration;
    }

    void judge(StepGuard::Outcome outcome) {
        if (outcome == StepGuard::Outcome::taken || outcome == StepGuard::Outcome::skipped) return;
        refresh_cells();
        if (outcome == StepGuard::Outcome::rolled_back) {
            reporter_.warning(fmt::format("iteration {}: {}", state_.iteration, guard_.reason()));
            return;
        }
        save();
        failure("training diverged at iteration {}: {} roll-backs did not help ({}); the last good state is {}",
                state_.iteration, state_.guard.roll_backs - 1, guard_.reason(),
                checkpoint_.empty() ? "lost: no checkpoint was asked for" : checkpoint_.string());
    }

    void adapt_rays(std::int64_t samples) {
        const double factor =
            static_cast<double>(options_.samples) / static_cast<double>(std::max<std::int64_t>(samples, 1));
        const double wanted = static_cast<double>(state_.rays) * std::clamp(factor, 0.5, 2.0);
        state_.rays = std::clamp<std::int64_t>(static_cast<std::int64_t>(wanted), 64, options_.samples);
    }

    void tell() {
        last_told_ = state_.seconds;
        const double done = std::min(share(), 1.0);
        Json event{{"event", "progress"},
                   {"iteration", state_.iteration},
                   {"loss", state_.guard.level},
                   {"rays", state_.rays},
                   {"psnr", psnr_of(state_.guard.level)},
                   {"skipped", state_.guard.skipped},
                   {"roll_backs", state_.guard.roll_backs},
                   {"eta_s", done > 0 ? state_.seconds * (1 - done) / done : 0.0}};
        const double total = options_.iterations
                                 ? static_cast<double>(*options_.iterations)
                                 : std::ceil(static_cast<double>(state_.iteration) / std::max(done, 1e-9));
        event["total"] = static_cast<std::int64_t>(total);
        reporter_.event(event);
    }

    void save() {
        if (checkpoint_.empty()) return;
        save_checkpoint(checkpoint_, state_, run_description());
        last_saved_ = state_.seconds;
    }

    double measured_psnr() const {
        const ImageSet& set = data_.validation.cameras.empty() ? data_.images_at(state_.iteration) : data_.validation;
        const std::size_t count = std::min<std::size_t>(4, set.cameras.size());
        double total = 0;
        RenderOptions options;
        options.march.step = options_.step;
        const auto& background = data_.geometry.background;
        for (std::size_t i = 0; i < count; ++i) {
            const Camera& camera = set.cameras[i];
            const Rays rays = rays_of_view(camera);
            const RenderedView view =
                render_view(*state_.field, {rays.origins, rays.directions}, camera.height, camera.width, options);
            const Tensor pixels = set.pixels[i].to(at::kFloat) / 255;
            const Tensor rgb = pixels.narrow(2, 0, 3);
            const Tensor alpha = pixels.size(2) == 4 ? pixels.select(2, 3) : at::ones_like(pixels.select(2, 0));
            const Tensor target = over_background_color(rgb * alpha.unsqueeze(2), alpha, background);
            const Tensor shown = over_background_color(view.color, view.alpha, background).clamp(0, 1);
            total += psnr_of((shown - target).square().mean().item<double>());
        }
        return total / static_cast<double>(count);
    }

    TrainResult finish() {
        if (guard_.settle()) {
            refresh_cells();
            reporter_.warning("the loss rose at the end: the field is the last good state before that");
        }
        save();
        state_.occupancy.refresh_all(*state_.field, state_.random);
        refresh_cells();
        state_.field->freeze();
        return {state_.field,
                {state_.iteration, state_.guard.skipped, state_.guard.roll_backs, state_.samples, state_.seconds,
                 measured_psnr(), peak_mib(), precision_name()}};
    }

    const TrainingData& data_;
    const TrainOptions options_;
    const Reporter& reporter_;
    const std::filesystem::path checkpoint_;
    TrainState state_;
    StepGuard guard_;
    MarchGrid cells_;  // of the field's occupancy
    Stopwatch watch_;
    double before_ = 0, last_saved_ = 0, last_told_ = 0;
};

// The budget's field, with no more entries a level than there are pixels: few of them would otherwise each find entries
// of their own to remember them by.
HashFieldConfig field_for(const TrainingData& data, const TrainOptions& options) {
    HashFieldConfig config = options.field_config();
    double pixels = 0;
    for (const Camera& camera : data.train.cameras) pixels += static_cast<double>(camera.width) * camera.height;
    const int most = std::max(12, static_cast<int>(std::log2(std::max(pixels, 1.0))));
    config.log2_table_size = std::min(config.log2_table_size, most);
    return config;
}

}  // namespace

double TrainOptions::budget() const {
    return minutes.value_or(preset_minutes(quality));
}

HashFieldConfig TrainOptions::field_config() const {
    HashFieldConfig config = field.value_or(HashFieldConfig());
    if (field || iterations) return config;
    // What reached furthest on lego in so much time (docs/accuracy-and-time.md).
    const double minutes_worth = budget() * speed;
    config.log2_table_size = minutes_worth < 0.4 ? 16 : minutes_worth < 1 ? 17 : 18;
    if (minutes_worth < 2) config.density_hidden = config.color_hidden = 32;
    return config;
}

Precision TrainOptions::network_precision() const {
    if (precision == "bfloat16") return Precision::bfloat16;
    if (precision == "float32") return Precision::float32;
    input_error("precision \"{}\" is unknown: bfloat16 or float32", precision);
}

void TrainOptions::check() const {
    preset_minutes(quality);
    network_precision();
    if (minutes && iterations) input_error("give --minutes or --iterations, not both");
    if (minutes && !(*minutes > 0 && std::isfinite(*minutes)))
        input_error("minutes must be positive, not {}", *minutes);
    if (iterations && *iterations < 1) input_error("iterations must be at least 1, not {}", *iterations);
    if (samples < 256 || samples > (1 << 24)) input_error("samples an iteration must be 256 to 2^24, not {}", samples);
    if (!(rate > 0 && rate <= 1)) input_error("the learning rate must lie in (0, 1], not {}", rate);
    if (!(rate_end > 0 && rate_end <= 1)) input_error("the rate's final factor must lie in (0, 1], not {}", rate_end);
    if (!(step >= 0)) input_error("the march's step must be positive, not {}", step);
    if (occupancy_resolution < 1 || occupancy_resolution > 1024) {
        input_error("the occupancy resolution must be 1 to 1024, not {}", occupancy_resolution);
    }
}

Json TrainReport::to_json() const {
    return {{"iterations", iterations}, {"skipped", skipped}, {"roll_backs", roll_backs}, {"samples", samples},
            {"seconds", seconds},       {"psnr", psnr},       {"peak_mib", peak_mib},     {"precision", precision}};
}

TrainResult train_field(const TrainingData& data, const TrainOptions& options, const Reporter& reporter,
                        const std::filesystem::path& checkpoint, bool resume) {
    options.check();
    data.check();
    keep_freed_memory();
    if (resume && checkpoint.empty()) throw std::invalid_argument("resume needs the path of a checkpoint");
    TrainOptions complete = options;
    // Going on for longer is the same run, whatever table a new one would take.
    if (!options.field) complete.field = resume ? checkpoint_field(checkpoint) : field_for(data, options);
    Trainer trainer(data, complete, reporter, checkpoint);
    if (resume) trainer.resume();
    return trainer.run();
}

TrainResult train_field(const Scene& scene, const TrainOptions& options, const Reporter& reporter,
                        const std::filesystem::path& checkpoint, bool resume) {
    const TrainingData data = training_data_of(scene, options.image_bytes, options.seed);
    for (const std::string& line : remarks(data)) reporter.warning(line);
    return train_field(data, options, reporter, checkpoint, resume);
}

}  // namespace fieldgraft
