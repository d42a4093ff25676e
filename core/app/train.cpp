// fieldgraft train SCENE -o FIELD.safetensors: fits the original field to a scene's images.
#include "core/train/trainer.h"

#include <memory>
#include <regex>

#include "core/app/console.h"
#include "core/base/errors.h"
#include "core/profile/forecast.h"
#include "core/profile/machine_rates.h"

namespace fieldgraft::app {
namespace {

struct TrainArguments {
    std::string scene, output, backbone = "hash";
    TrainOptions train;
    double minutes = 0, downscale = 1, image_memory = static_cast<double>(usual_image_bytes) / (1ll << 30);
    std::int64_t iterations = 0;
    int table = 0, levels = 0, width = 0;  // 0: as the time given asks for
    std::string error;                     // "30dB": train for as long as that takes
    bool resume = false;
};

bool has_own_field(const TrainArguments& options) {
    return options.table > 0 || options.levels > 0 || options.width > 0;
}

double decibels(const std::string& text) {
    static const std::regex form(R"(\s*([0-9]{1,2}(\.[0-9]+)?)\s*(dB)?\s*)");
    std::smatch parts;
    if (!std::regex_match(text, parts, form)) input_error("--error {}: a PSNR is needed, such as 30dB", text);
    return std::stod(parts[1]);
}

// How long a PSNR takes on this scene and machine, told from a probe of both. The probe itself, if it is enough.
std::optional<TrainResult> plan_for_error(TrainArguments& options, const TrainingData& data, const Reporter& reporter) {
    const double asked = decibels(options.error);
    Probe probed = probe(data, options.train.seed, reporter);
    const Forecast& told = probed.forecast;
    const std::optional<double> minutes = told.minutes_for(asked);
    if (!minutes) {
        input_error("--error {}: this scene is likely to reach {:.1f} dB in {:g} minutes on this machine; ask for less",
                    options.error, told.psnr_after(Forecast::most_minutes), Forecast::most_minutes);
    }
    reporter.event({{"event", "forecast"}, {"minutes", *minutes}, {"psnr", told.psnr_after(*minutes)}});
    options.train.minutes = minutes;
    const bool enough = asked <= probed.result.report.psnr && !has_own_field(options);
    return enough ? std::optional(std::move(probed.result)) : std::nullopt;
}

// What so many iterations will take on a machine that has been measured.
void tell_time(const TrainOptions& options, const Reporter& reporter) {
    const std::optional<MachineRates> rates = load_rates();
    if (!rates || !options.iterations) return;
    const double samples = static_cast<double>(*options.iterations * options.samples);
    reporter.event(
        {{"event", "forecast"}, {"minutes", training_seconds(*rates, options.field_config(), samples) / 60}});
}

// What the budget would take, with what the user set instead.
void set_field(TrainArguments& options) {
    if (!has_own_field(options)) return;
    HashFieldConfig config = options.train.field_config();
    if (options.table > 0) config.log2_table_size = options.table;
    if (options.levels > 0) config.levels = options.levels;
    if (options.width > 0) config.density_hidden = config.color_hidden = options.width;
    options.train.field = config;
}

void run_train(const CommonOptions& common, TrainArguments options) {
    if (options.backbone != "hash")
        input_error("--backbone {}: this version trains the hash backbone; use --backbone hash", options.backbone);
    if (options.minutes > 0) options.train.minutes = options.minutes;
    if (options.iterations > 0) options.train.iterations = options.iterations;
    if (!options.error.empty()) decibels(options.error);  // nonsense is said before anything is read
    options.train.seed = common.seed;
    options.train.image_bytes = static_cast<std::int64_t>(options.image_memory * (1ll << 30));
    const Reporter reporter = console_reporter(common, "train");
    SceneOptions scene_options;
    scene_options.downscale = options.downscale;
    const Scene scene = Scene::load(options.scene, scene_options);
    for (const std::string& warning : scene.warnings()) reporter.warning(warning);

    const std::filesystem::path output = options.output;
    std::filesystem::path checkpoint = output;
    checkpoint.replace_extension(".checkpoint.safetensors");
    const TrainingData data = training_data_of(scene, options.train.image_bytes, common.seed);
    for (const std::string& line : remarks(data)) reporter.warning(line);
    if (const auto rates = load_rates()) options.train.speed = rates->speed();
    std::optional<TrainResult> probed;
    if (!options.error.empty()) probed = plan_for_error(options, data, reporter);
    set_field(options);
    tell_time(options.train, reporter);
    const TrainResult result =
        probed ? *probed : train_field(data, options.train, reporter, checkpoint, options.resume);
    Json figures = result.report.to_json();
    // No times in the file: the same seed gives the same bytes.
    result.field->save(output,
                       {{"training", {{"iterations", result.report.iterations}, {"psnr", result.report.psnr}}}});
    std::filesystem::remove(checkpoint);  // the field is complete: there is nothing to go on with
    figures["path"] = output.string();
    figures["field_hash"] = result.field->hash();
    print_done(common, figures);
}

}  // namespace

void add_train(Program& program) {
    auto options = std::make_shared<TrainArguments>();
    CLI::App* app = program.command("train", "fit a field to a scene's images");
    app->add_option("SCENE", options->scene, "folder or transforms*.json: NeRF-synthetic, nerfstudio, instant-ngp")
        ->required();
    app->add_option("-o,--output", options->output, "the field, FIELD.safetensors")->required();
    app->add_option("--backbone", options->backbone, "hash")->check(CLI::IsMember({"hash", "mlp"}));
    auto* quality = app->add_option("--quality", options->train.quality, "draft, preview or final: 1, 3 or 10 minutes")
                        ->check(CLI::IsMember({"draft", "preview", "final"}));
    auto* minutes = app->add_option("--minutes", options->minutes, "train for so long")->check(CLI::PositiveNumber);
    auto* iterations =
        app->add_option("--iterations", options->iterations, "train for so many steps")->check(CLI::PositiveNumber);
    minutes->excludes(iterations)->excludes(quality);
    iterations->excludes(quality);
    app->add_option("--error", options->error,
                    "train for as long as this PSNR takes, such as 30dB: told from sixteen seconds on the scene itself")
        ->excludes(minutes)
        ->excludes(iterations)
        ->excludes(quality);
    app->add_option("--precision", options->train.precision,
                    "of the networks while training: bfloat16 (where the machine is fast at it) or float32")
        ->check(CLI::IsMember({"bfloat16", "float32"}));
    const std::string usual = " (default: by the time given; docs/accuracy-and-time.md)";
    app->add_option("--table", options->table, "log₂ of the hash table's entries a level" + usual)
        ->check(CLI::Range(10, 24));
    app->add_option("--levels", options->levels, "of the encoding" + usual)->check(CLI::Range(1, 32));
    app->add_option("--width", options->width, "of the networks' hidden layers" + usual)->check(CLI::Range(8, 256));
    app->add_option("--samples", options->train.samples, "visible samples an iteration aims at")
        ->check(CLI::Range(256, 1 << 24));
    app->add_option("--downscale", options->downscale, "reduce the images by this factor")
        ->check(CLI::Range(1.0, 64.0));
    app->add_option("--image-memory", options->image_memory, "GiB of training images in memory; more are streamed")
        ->check(CLI::Range(0.001, 1024.0));
    app->add_flag("--resume", options->resume, "go on from the checkpoint beside the output");
    app->callback(
        [&program, options] { program.action = [&program, options] { run_train(program.common, *options); }; });
}

}  // namespace fieldgraft::app
