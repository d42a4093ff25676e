// fieldgraft edit FIELD [EDIT…] -o EDIT.safetensors: trains an edit from a text prompt.
#include <memory>

#include "core/app/console.h"
#include "core/app/inputs.h"
#include "core/base/errors.h"
#include "core/edit/edit_loop.h"

namespace fieldgraft::app {
namespace {

struct EditArguments {
    std::vector<std::string> files, masks, weights;
    std::string output, source, target, ops, scene, guidance, segmenter, preset = "builtin", quality, region_text,
                                                                         preview;
    double tau_add = -1, tau_remove = -1, tau_change = -1, minutes = 0;
    int dilate = -1, patch = 0, augmentations = 0, iterations = 0;
    bool mask_only = false, resume = false;
};

void set_weights(EditSpec& spec, const std::vector<std::string>& weights) {
    for (const std::string& argument : weights) {
        const auto equals = argument.find('=');
        char* end = nullptr;
        const double value = equals == std::string::npos ? 0 : std::strtod(argument.c_str() + equals + 1, &end);
        if (equals == std::string::npos || end == argument.c_str() + equals + 1 || *end != '\0')
            input_error("--weight {}: expected NAME=X with a number X", argument);
        spec.set_weight(argument.substr(0, equals), value);
    }
}

// The preset, changed by whatever the user named.
EditSpec specification(const CommonOptions& common, const EditArguments& options) {
    EditSpec spec = EditSpec::from_preset(options.preset, Operations::parse(options.ops));
    spec.source = options.source;
    spec.target = options.target;
    spec.region_text = options.region_text;
    if (options.tau_add >= 0) spec.tau.add = options.tau_add;
    if (options.tau_remove >= 0) spec.tau.remove = options.tau_remove;
    if (options.tau_change >= 0) spec.tau.change = options.tau_change;
    if (options.dilate >= 0) spec.dilation = options.dilate;
    if (options.patch > 0) spec.patch = options.patch;
    if (options.augmentations > 0) spec.augmentations = options.augmentations;
    if (!options.quality.empty()) spec.quality = options.quality;
    spec.iterations = options.iterations;
    spec.minutes = options.minutes;
    spec.seed = common.seed;
    set_weights(spec, options.weights);
    for (const std::string& argument : options.masks) {
        const NamedFile mask = parse_view_file(argument, "--mask");
        spec.masks.push_back({mask.view, mask.file});
    }
    if (options.mask_only && spec.masks.empty())
        input_error("--mask-only: no masks; give at least one --mask VIEW:FILE");
    if (!spec.masks.empty()) spec.region_source = options.mask_only ? RegionSource::masks : RegionSource::both;
    return spec;
}

void run_edit(const CommonOptions& common, const EditArguments& options) {
    const Reporter reporter = console_reporter(common, "edit");
    const EditSpec spec = specification(common, options);
    FieldWithEdits base = load_field_and_edits(options.files, reporter);
    // Bad prompts are said before models and scenes are loaded.
    spec.validate(base.field->geometry().image_width, base.field->geometry().image_height);
    EditInputs inputs{base.field, std::move(base.edits), nullptr, nullptr};
    const std::filesystem::path guide =
        options.guidance.empty() ? builtin_model("guide") : std::filesystem::path(options.guidance);
    inputs.guide = Guidance::load(guide, options.segmenter, {.image_type = fastest_image_type()});
    std::unique_ptr<Scene> scene;
    if (!options.scene.empty()) {
        scene = std::make_unique<Scene>(load_scene_of(*inputs.field, options.scene, {}, reporter));
        inputs.scene = scene.get();
    }
    EditRunOptions run_options;
    run_options.checkpoint = std::filesystem::path(options.output).replace_extension(".checkpoint.safetensors");
    run_options.resume = options.resume;
    run_options.preview = options.preview;
    const EditResult result = train_edit(inputs, spec, run_options, reporter);
    result.edit.save(options.output);
    std::filesystem::remove(run_options.checkpoint);
    Json figures = result.report.to_json();
    figures["path"] = options.output;
    figures["hash"] = result.edit.hash();
    print_done(common, figures);
}

void add_text_options(CLI::App* app, EditArguments& options) {
    app->add_option("--source", options.source, "what is there, e.g. \"bulldozer\"")->required();
    app->add_option("--target", options.target, "what it becomes, e.g. \"red bulldozer\"")->required();
    app->add_option("--ops", options.ops, "change, add, remove, or several with commas")->required();
    app->add_option("--region", options.region_text, "what the segmenter looks for (default: --source)");
    app->add_option("--scene", options.scene, "the field's scene: its poses and the views of masks");
    app->add_option("--guidance", options.guidance, "folder of a guidance model (default: the built-in one)");
    app->add_option("--segmenter", options.segmenter, "folder of another segmenter");
    app->add_option("--mask", options.masks, "VIEW:FILE, white where to edit (repeatable)");
    app->add_flag("--mask-only", options.mask_only, "use the masks instead of the segmenter");
}

void add_schedule_options(CLI::App* app, EditArguments& options) {
    app->add_option("--preset", options.preset, "builtin, paper-hash, paper-mlp");
    app->add_option("--tau-add", options.tau_add, "share that may be added")->check(CLI::Range(0.0, 1.0));
    app->add_option("--tau-remove", options.tau_remove, "share that may be removed")->check(CLI::Range(0.0, 1.0));
    app->add_option("--tau-change", options.tau_change, "share that may be recoloured")->check(CLI::Range(0.0, 1.0));
    app->add_option("--dilate", options.dilate, "dilations of the region")->check(CLI::Range(0, 100));
    app->add_option("--weight", options.weights, "NAME=X, weight of a loss (repeatable)");
    app->add_option("--patch", options.patch, "patch edge in pixels")->check(CLI::Range(8, 1024));
    app->add_option("--augmentations", options.augmentations, "augmented images a step")->check(CLI::Range(1, 256));
    auto* quality = app->add_option("--quality", options.quality, "draft, preview or final")
                        ->check(CLI::IsMember({"draft", "preview", "final"}));
    auto* minutes = app->add_option("--minutes", options.minutes, "train for so long")->check(CLI::PositiveNumber);
    auto* iterations =
        app->add_option("--iterations", options.iterations, "train for so many steps")->check(CLI::PositiveNumber);
    minutes->excludes(iterations)->excludes(quality);
    iterations->excludes(quality);
}

}  // namespace

void add_edit(Program& program) {
    auto options = std::make_shared<EditArguments>();
    CLI::App* app = program.command("edit", "edit a field from a text prompt");
    app->add_option("FILES", options->files, "FIELD [EDIT…]: the edits below this one")->required();
    app->add_option("-o,--output", options->output, "the edit, EDIT.safetensors")->required();
    add_text_options(app, *options);
    add_schedule_options(app, *options);
    app->add_option("--preview", options->preview, "a PNG that shows the edit while it trains");
    app->add_flag("--resume", options->resume, "go on from the checkpoint beside the output");
    app->callback(
        [&program, options] { program.action = [&program, options] { run_edit(program.common, *options); }; });
}

}  // namespace fieldgraft::app
