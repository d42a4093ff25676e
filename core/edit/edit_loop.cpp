#include "core/edit/edit_loop.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/errors.h"
#include "core/edit/adam.h"
#include "core/edit/edit_preview.h"
#include "core/edit/edit_state.h"
#include "core/edit/edit_step.h"
#include "core/edit/first_color.h"
#include "core/edit/patch_source.h"
#include "core/field/edit_support.h"

namespace fieldgraft {

namespace {

// Losses of single patches differ: only what is far off has blown up.
constexpr GuardLimits guard_limits{.interval = 64, .first_steps = 16, .worse = 4};
constexpr std::uint64_t loop_stream = 1;

using LossIterator = std::vector<double>::const_iterator;
double mean_of(LossIterator first, LossIterator last) {
    return first == last ? 0 : std::accumulate(first, last, 0.0) / static_cast<double>(last - first);
}

class EditTraining {
  public:
    EditTraining(const EditInputs& inputs, const EditSpec& spec, const EditRunOptions& options,
                 const Reporter& reporter)
        : inputs_(inputs),
          spec_(spec),
          options_(options),
          reporter_(reporter),
          plan_(EditPlan::compile(spec)),
          base_(inputs.field, inputs.stack),
          cameras_(base_.geometry(), spec, inputs.scene),
          text_(inputs.guide, spec, plan_),
          field_(std::make_shared<EditField>(field_config(), base_.geometry(), spec.seed)),
          adam_(field_->parameters()),
          guard_(
              state_.guard,
              {[this] { return learnt(*field_, adam_); }, [this](const auto& good) { put_back(good, *field_, adam_); }},
              guard_limits),
          patches_(base_, cameras_, spec_, plan_, region_, *inputs.guide) {}

    EditResult run() {
        reporter_.event({{"event", "plan"}, {"plan", plan_.to_json()}});
        warn_of_unknown_words();
        start();
        cameras_.set_focus(region_.centre);
        while (!finished()) iterate();
        return finish();
    }

  private:
    EditFieldConfig field_config() const {
        EditFieldConfig config;
        config.operations = spec_.operations;
        config.resolutions = spec_.resolutions;
        return config;
    }

    // What a checkpoint must agree with.
    Json identity() const {
        return {{"specification", spec_.to_json()},
                {"field", base_.field_hash()},
                {"stack", base_.stack_hashes()},
                {"guide", inputs_.guide->hash()}};
    }

    void warn_of_unknown_words() const {
        for (const std::string& text : {spec_.source, spec_.target, spec_.segmented_text()})
            for (const std::string& word : inputs_.guide->unknown_words(text))
                reporter_.warning(
                    fmt::format("the guide never saw the word \"{}\" (in \"{}\"); the edit may miss it", word, text));
    }

    void start() {
        state_.random = Random(spec_.seed, loop_stream);
        const bool saved = !options_.checkpoint.empty() && std::filesystem::exists(options_.checkpoint);
        if (options_.resume && saved) {
            const Checkpoint checkpoint = load_checkpoint(options_.checkpoint, identity());
            put_back(checkpoint.tensors, *field_, adam_);
            state_ = checkpoint.state;
            region_ = checkpoint.region;
            guard_.keep(state_.iteration);
            return;
        }
        const Stopwatch watch;
        region_ = find_region(base_, *inputs_.guide, spec_, plan_, cameras_, inputs_.scene, reporter_);
        Json event{{"event", "region"}};
        event.update(region_.to_json());
        reporter_.event(event);
        cameras_.set_focus(region_.centre);
        if (spec_.seek_first_color && (spec_.operations.add || spec_.operations.change)) seek_first_color();
        guard_.keep(0);
        setup_seconds_ = watch.seconds();
    }

    void seek_first_color() {
        std::vector<FrozenPatch> patches;
        for (std::uint64_t number = 0; number < 16 && patches.size() < 4; ++number) {
            const FrozenPatch patch = patches_.patch(number);
            if (patch.area > 0 && patch.acting.size(0) > 0) patches.push_back(patch);
        }
        if (patches.empty()) return;  // the region is in none of them
        const auto color =
            best_first_color(patches, text_, spec_, plan_, longest_edge(base_.geometry()), Random(spec_.seed, 2));
        field_->set_first_color(color);
        reporter_.event({{"event", "first_color"}, {"color", color}});
    }

    // 0 … 1: how much of the run is over.
    double progress() const {
        if (const int planned = spec_.planned_iterations(); planned > 0)
            return static_cast<double>(state_.iteration) / planned;
        return (state_.seconds + setup_seconds_) / (60 * spec_.minutes);
    }
    bool finished() const { return progress() >= 1; }
    double position() const { return progress() * spec_.nominal_iterations; }

    double learning_rate() const {
        return state_.guard.scale *
               annealed(spec_.learning_rate, spec_.learning_rate_end, position(), spec_.learning_rate_iterations);
    }

    void fade_levels() {
        const auto levels = static_cast<double>(spec_.resolutions.size());
        if (spec_.fade_levels <= 0 || levels < 2) return;
        const double reached = 1 + (levels - 1) * std::min(1.0, progress() / spec_.fade_levels);
        std::vector<float> weights;
        for (int level = 0; level < levels; ++level)
            weights.push_back(static_cast<float>(std::clamp(reached - level, 0.0, 1.0)));
        field_->set_level_weights(weights);
    }

    void iterate() {
        const Stopwatch watch;
        fade_levels();
        const int pool = spec_.camera_pool;
        // The pool is filled first, then drawn from.
        const std::uint64_t number = pool > 0 && state_.iteration >= pool
                                         ? state_.random.below(static_cast<std::uint32_t>(pool))
                                         : static_cast<std::uint64_t>(state_.iteration);
        const StepLosses losses =
            backward_step(*field_, patches_.patch(number), text_, spec_, plan_, position(), state_.random);
        judge(take_step(losses), losses.total);
        ++state_.iteration;
        state_.seconds += watch.seconds();
        state_.tower_seconds += losses.tower_seconds;
        losses_.push_back(losses.total);
        report(losses);
        preview(false);
        const bool stop = reporter_.stop_requested();
        if (stop || since_checkpoint_.seconds() > options_.checkpoint_seconds) checkpoint();
        if (stop && !finished()) throw Cancelled();
    }

    // False if loss or gradients are not finite: nothing is changed then.
    bool take_step(const StepLosses& losses) {
        if (std::isfinite(losses.total)) return adam_.step(learning_rate());
        for (const auto& [name, parameter] : field_->parameters()) Tensor(parameter).mutable_grad() = Tensor();
        return false;
    }

    void judge(bool taken, double loss) {
        const StepGuard::Outcome outcome = guard_.after_step(taken, loss, state_.iteration);
        if (outcome == StepGuard::Outcome::rolled_back)
            reporter_.warning(fmt::format("iteration {}: {}", state_.iteration, guard_.reason()));
        if (outcome != StepGuard::Outcome::given_up) return;
        checkpoint();
        failure("the edit diverged at iteration {}: {} roll-backs did not help ({}); the last good state is {}",
                state_.iteration, state_.guard.roll_backs - 1, guard_.reason(),
                options_.checkpoint.empty() ? "lost: no checkpoint was asked for" : options_.checkpoint.string());
    }

    void checkpoint() {
        since_checkpoint_ = Stopwatch();
        if (!options_.checkpoint.empty())
            save_checkpoint(options_.checkpoint, state_, *field_, adam_, region_, identity());
    }

    void report(const StepLosses& losses) {
        if (state_.iteration > 1 && since_report_.seconds() < 0.5 && !finished()) return;
        since_report_ = Stopwatch();
        const double done = std::max(progress(), 1e-6),
                     spent = state_.seconds + (spec_.planned_iterations() ? 0 : setup_seconds_);
        const int planned = spec_.planned_iterations();
        const int total = planned > 0 ? planned : std::max(state_.iteration, static_cast<int>(state_.iteration / done));
        reporter_.event({{"event", "progress"},
                         {"stage", "edit"},
                         {"iteration", state_.iteration},
                         {"total", total},
                         {"loss", losses.total},
                         {"terms", losses.terms},
                         {"skipped", state_.guard.skipped},
                         {"roll_backs", state_.guard.roll_backs},
                         {"eta_s", std::max(0.0, spent / done - spent)}});
    }

    void preview(bool last) {
        if (options_.preview.empty() || (!last && since_preview_.seconds() < options_.preview_seconds)) return;
        if (!preview_patch_.positions.defined()) {
            const std::vector<Camera> cameras = cameras_.survey(8, preview_size);
            preview_patch_ = patches_.view(cameras[3], preview_size);
        }
        write_preview(options_.preview, *field_, preview_patch_, plan_, {spec_.compositing, spec_.removed});
        reporter_.event({{"event", "preview"}, {"path", options_.preview.string()}});
        since_preview_ = Stopwatch();
    }

    // Means of the maps over the region in some of the training views, g truncated to its support.
    void measure(EditReport& report) {
        at::NoGradGuard no_gradients;
        double area = 0;
        for (std::uint64_t number = 0; number < 8; ++number) {
            const FrozenPatch patch = patches_.patch(number);
            const RenderedEdit r =
                render_edit(*field_, patch, plan_, {spec_.compositing, spec_.removed}, at::ones({3}));
            const auto inside = [&](const Tensor& map) {
                return map.defined() ? map.masked_select(patch.masks.positive).sum().item<double>() : 0.0;
            };
            report.added += inside(r.added);
            report.removed += inside(r.removed);
            report.changed += inside(r.changed);
            area += patch.area;
        }
        for (double* mean : {&report.added, &report.removed, &report.changed}) *mean /= std::max(1.0, area);
    }

    EditResult finish() {
        if (guard_.settle()) reporter_.warning("the loss rose at the end: the edit is the last good state before that");
        field_->set_level_weights(std::vector<float>(spec_.resolutions.size(), 1.0f));
        const Tensor candidates = support_candidates(spec_.operations, base_, region_);
        const Tensor support = edit_support(*field_, candidates, march_step(base_.geometry(), {}));
        field_->set_support(support);
        preview(true);
        EditReport report;
        report.iterations = state_.iteration;
        report.skipped = static_cast<int>(state_.guard.skipped);
        report.roll_backs = static_cast<int>(state_.guard.roll_backs);
        report.seconds = state_.seconds + setup_seconds_;
        const double count = std::max(1, state_.iteration);
        report.seconds_per_iteration = state_.seconds / count;
        report.field_seconds_per_iteration = (state_.seconds - state_.tower_seconds) / count;
        const std::size_t tail = std::min(losses_.size(), losses_.size() / 10 + 1);
        report.first_loss = mean_of(losses_.begin(), losses_.begin() + static_cast<std::ptrdiff_t>(tail));
        report.loss = mean_of(losses_.end() - static_cast<std::ptrdiff_t>(tail), losses_.end());
        report.region_share = region_.share;
        report.support_share = support.to(at::kFloat).mean().item<double>();
        measure(report);
        if (report.support_share == 0)
            reporter_.warning("the edit changes nothing: every part of it fell under the threshold");
        EditFile file;
        file.field = field_;
        file.field_hash = base_.field_hash();
        file.stack = base_.stack_hashes();
        file.specification = spec_.to_json();
        return {file, report, region_};
    }

    static constexpr int preview_size = 160;

    const EditInputs& inputs_;
    EditSpec spec_;
    EditRunOptions options_;
    const Reporter& reporter_;
    EditPlan plan_;
    BaseMedium base_;
    EditCameras cameras_;
    TextObjective text_;
    std::shared_ptr<EditField> field_;
    Adam adam_;
    EditState state_;
    StepGuard guard_;
    EditRegion region_;
    PatchSource patches_;
    FrozenPatch preview_patch_;
    std::vector<double> losses_;
    double setup_seconds_ = 0;
    Stopwatch since_checkpoint_, since_report_, since_preview_;
};

}  // namespace

Json EditReport::to_json() const {
    return {{"iterations", iterations},
            {"skipped", skipped},
            {"roll_backs", roll_backs},
            {"seconds", seconds},
            {"seconds_per_iteration", seconds_per_iteration},
            {"field_seconds_per_iteration", field_seconds_per_iteration},
            {"first_loss", first_loss},
            {"loss", loss},
            {"region_share", region_share},
            {"support_share", support_share},
            {"added", added},
            {"removed", removed},
            {"changed", changed}};
}

EditResult train_edit(const EditInputs& inputs, const EditSpec& spec, const EditRunOptions& options,
                      const Reporter& reporter) {
    if (!inputs.field || !inputs.guide) throw std::invalid_argument("train_edit: a field and a guide are needed");
    spec.validate(inputs.field->geometry().image_width, inputs.field->geometry().image_height);
    return EditTraining(inputs, spec, options, reporter).run();
}

}  // namespace fieldgraft
