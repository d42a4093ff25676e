// fieldgraft profile SCENE|FIELD [EDIT…]: what accuracy costs in time, as tables and charts. With --calibrate: how fast
// this machine is, for later predictions; with --forecast: what training a scene will reach.
#include <algorithm>
#include <memory>

#include "core/app/console.h"
#include "core/app/inputs.h"
#include "core/base/errors.h"
#include "core/edit/edit_cameras.h"
#include "core/profile/forecast.h"
#include "core/profile/machine_rates.h"
#include "core/profile/report.h"
#include "core/profile/sweeps.h"

namespace fieldgraft::app {
namespace {

struct ProfileArguments {
    std::vector<std::string> files, sweeps, knobs;
    std::string output, scene, guidance, judge;
    int views = 3, repeats = 3, resolution = 256;
    double minutes = 1;
    bool resume = false, calibrate = false, forecast = false;
};

// What is measured on: given files, and what was made of them.
struct Inputs {
    FieldWithEdits fields;  // no field: a scene alone
    std::unique_ptr<Scene> scene;
    std::vector<View> views;  // of the scene
    std::vector<Camera> cameras;
    std::string name;
};

bool is_field(const std::string& path) {
    return std::filesystem::path(path).extension() == ".safetensors";
}

// `count` of them, evenly spread.
template <class T>
std::vector<T> spread(const std::vector<T>& all, int count) {
    std::vector<T> some;
    const std::size_t n = std::min(all.size(), static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < n; ++i) some.push_back(all[i * all.size() / n]);
    return some;
}

void read_scene(const ProfileArguments& options, const std::string& path, const Reporter& reporter, Inputs& inputs) {
    inputs.scene = inputs.fields.field
                       ? std::make_unique<Scene>(load_scene_of(*inputs.fields.field, path, {}, reporter))
                       : std::make_unique<Scene>(Scene::load(path));
    const std::vector<View> test = inputs.scene->views("test");
    inputs.views = spread(test.empty() ? inputs.scene->validation_views() : test, options.views);
    for (const View& view : inputs.views) inputs.cameras.push_back(view.camera);
    inputs.name = inputs.scene->name();
}

Inputs read_inputs(const ProfileArguments& options, const Reporter& reporter) {
    Inputs inputs;
    const std::string& first = options.files.front();
    if (!is_field(first)) {
        if (options.files.size() > 1 || !options.scene.empty())
            input_error("{}: a scene is profiled alone; to profile a field give FIELD.safetensors first", first);
        read_scene(options, first, reporter, inputs);
        return inputs;
    }
    inputs.fields = load_field_and_edits(options.files, reporter);
    inputs.name = std::filesystem::path(first).stem().string();
    if (!options.scene.empty()) {
        read_scene(options, options.scene, reporter, inputs);
        return inputs;
    }
    const FieldGeometry& geometry = inputs.fields.field->geometry();
    const EditCameras cameras(geometry, EditSpec(), nullptr);
    inputs.cameras = cameras.survey(options.views, std::min(geometry.image_width, geometry.image_height));
    return inputs;
}

// The sweeps that the inputs allow, or those asked for.
std::vector<std::string> chosen_sweeps(const ProfileArguments& options, const Inputs& inputs) {
    const auto possible = [&](const std::string& sweep) {
        if (sweep == "training") return inputs.scene != nullptr;
        if (sweep == "editing") return !inputs.fields.edits.empty();
        return inputs.fields.field != nullptr;
    };
    std::vector<std::string> chosen;
    for (const std::string& sweep : known_sweeps()) {
        // A field is there already: training it again has to be asked for.
        if (options.sweeps.empty() && possible(sweep) && (sweep != "training" || !inputs.fields.field))
            chosen.push_back(sweep);
    }
    for (const std::string& sweep : options.sweeps) {
        if (!possible(sweep))
            input_error("--sweeps {}: it needs {}", sweep,
                        sweep == "training"  ? "a scene (SCENE, or --scene beside a field)"
                        : sweep == "editing" ? "FIELD and EDIT"
                                             : "FIELD");
        chosen.push_back(sweep);
    }
    return chosen;
}

EditStack stack_of(const std::vector<EditFile>& edits) {
    EditStack stack;
    for (const EditFile& edit : edits) stack.push_back(stack_item(edit));
    return stack;
}

EditingInputs editing_inputs(const ProfileArguments& options, const Inputs& inputs) {
    EditingInputs editing;
    editing.base.field = inputs.fields.field;
    editing.base.stack.assign(inputs.fields.edits.begin(), inputs.fields.edits.end() - 1);
    editing.base.scene = inputs.scene.get();
    editing.spec = EditSpec::from_json(inputs.fields.edits.back().specification);
    editing.judge =
        Guidance::load(options.judge.empty() ? builtin_model("judge") : std::filesystem::path(options.judge));
    const std::filesystem::path guide =
        options.guidance.empty() ? builtin_model("guide") : std::filesystem::path(options.guidance);
    const auto loaded = [guide](torch::ScalarType type) {
        return [guide, type] { return Guidance::load(guide, {}, {.image_type = type}); };
    };
    const bool half = fastest_image_type() == torch::kBFloat16;
    editing.guides.emplace_back(half ? "bfloat16" : "float32", loaded(fastest_image_type()));
    if (half) editing.guides.emplace_back("float32", loaded(torch::kFloat));
    editing.cameras = inputs.cameras;
    return editing;
}

std::vector<Trial> trials_of(const std::string& sweep, const ProfileArguments& options, const CommonOptions& common,
                             const Inputs& inputs) {
    if (sweep == "training") return training_trials({inputs.scene.get(), inputs.views, options.minutes, common.seed});
    if (sweep == "rendering")
        return rendering_trials({inputs.fields.field, stack_of(inputs.fields.edits), inputs.cameras, options.repeats});
    if (sweep == "editing") return editing_trials(editing_inputs(options, inputs));
    return baking_trials(
        {inputs.fields.field, inputs.fields.edits, inputs.cameras, options.output, options.resolution});
}

// The usual settings and those of the knobs that are named, by the start of their names.
std::vector<Trial> of_knobs(const std::vector<Trial>& trials, const std::vector<std::string>& knobs) {
    std::vector<Trial> some;
    for (const Trial& trial : trials) {
        const auto named = [&](const std::string& knob) { return trial.knob.rfind(knob, 0) == 0; };
        if (trial.usual || knobs.empty() || std::any_of(knobs.begin(), knobs.end(), named)) some.push_back(trial);
    }
    for (const std::string& knob : knobs) {
        const auto has = [&](const Trial& trial) { return trial.knob.rfind(knob, 0) == 0; };
        if (std::any_of(trials.begin(), trials.end(), has)) continue;
        std::string names;
        for (std::size_t i = 0; i < trials.size(); ++i) {
            if (i == 0 || trials[i].knob != trials[i - 1].knob) names += (i == 0 ? "" : "; ") + trials[i].knob;
        }
        input_error("--knobs {}: there are {}", knob, names);
    }
    return some;
}

// What points are of: others' are never mixed with them.
Json description(const ProfileArguments& options, const CommonOptions& common, const Inputs& inputs) {
    Json about{{"name", inputs.name},
               {"views", options.views},
               {"repeats", options.repeats},
               {"minutes", options.minutes},
               {"resolution", options.resolution},
               {"seed", common.seed},
               {"threads", at::get_num_threads()}};
    if (inputs.fields.field) about["field"] = inputs.fields.field->hash();
    for (const EditFile& edit : inputs.fields.edits) about["edits"].push_back(edit.hash());
    return about;
}

void run_calibration(const CommonOptions& common, const ProfileArguments& options) {
    if (!options.files.empty()) input_error("--calibrate measures the machine and takes no files");
    const Stopwatch watch;
    const MachineRates rates = measure_machine(console_reporter(common, "calibrate"));
    save_rates(rates);
    Json figures = rates.to_json();
    figures["speed"] = rates.speed();
    figures["seconds"] = watch.seconds();
    figures["path"] = machine_file().string();
    print_done(common, figures);
}

// What training a scene for the usual times will come to.
void run_forecast(const CommonOptions& common, const ProfileArguments& options) {
    if (options.files.size() != 1 || is_field(options.files.front()))
        input_error("--forecast takes one SCENE, and trains on it for a moment");
    const Reporter reporter = console_reporter(common, "forecast");
    const Stopwatch watch;
    const TrainingData data = training_data_of(Scene::load(options.files.front()));
    const Forecast told = probe(data, common.seed, reporter).forecast;
    Json points = Json::array(), figures;
    for (const double minutes : {0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0}) {
        points.push_back({{"minutes", minutes}, {"psnr", told.psnr_after(minutes)}});
        figures[fmt::format("PSNR after {:g} min", minutes)] = told.psnr_after(minutes);
    }
    if (common.json) figures = {{"forecast", points}};
    figures["seconds"] = watch.seconds();
    print_done(common, figures);
}

void run_profile(const CommonOptions& common, const ProfileArguments& options) {
    if (options.calibrate) return run_calibration(common, options);
    if (options.forecast) return run_forecast(common, options);
    if (options.files.empty() || options.output.empty())
        input_error("profile: give SCENE or FIELD [EDIT…], and -o DIR; or --calibrate; or SCENE --forecast");
    const Reporter reporter = console_reporter(common, "profile");
    const Inputs inputs = read_inputs(options, reporter);
    if (inputs.cameras.empty()) input_error("{}: no views to measure on", inputs.name);
    std::vector<Trial> trials;
    for (const std::string& sweep : chosen_sweeps(options, inputs)) {
        for (Trial& trial : trials_of(sweep, options, common, inputs)) trials.push_back(std::move(trial));
    }
    trials = of_knobs(trials, options.knobs);
    const Stopwatch watch;
    const Json about = description(options, common, inputs);
    const std::vector<Point> points = run_trials(trials, about, options.output, options.resume, reporter);
    const auto written = write_report(points, about, options.output);
    print_done(
        common,
        {{"points", points.size()}, {"seconds", watch.seconds()}, {"files", written.size()}, {"path", options.output}});
}

}  // namespace

void add_profile(Program& program) {
    auto options = std::make_shared<ProfileArguments>();
    CLI::App* app = program.command("profile", "measure what accuracy costs in time");
    app->add_option("FILES", options->files, "SCENE (training), or FIELD [EDIT…] (rendering, baking, the last edit)");
    app->add_option("-o,--output", options->output, "a folder for tables and charts");
    app->add_flag("--forecast", options->forecast, "say what PSNR training will reach, from 16 seconds on the scene");
    app->add_flag(
        "--calibrate", options->calibrate,
        "measure this machine (ten seconds), so that train knows what fits into --minutes and info what things take");
    app->add_option("--scene", options->scene, "the field's scene: its test views and, for edits, its poses");
    app->add_option("--sweeps", options->sweeps, "training, rendering, editing, baking (default: what FILES allow)")
        ->delimiter(',')
        ->check(CLI::IsMember(known_sweeps()));
    app->add_option("--knobs", options->knobs, "only these, by the start of their names")->delimiter(',');
    app->add_option("--views", options->views, "views that are drawn and compared")->check(CLI::Range(1, 1000));
    app->add_option("--repeats", options->repeats, "timings of a picture, of which the median counts")
        ->check(CLI::Range(1, 100));
    app->add_option("--minutes", options->minutes, "training: of the usual setting; others take as many steps")
        ->check(CLI::PositiveNumber);
    app->add_option("--resolution", options->resolution, "baking: voxels an edge of the usual setting")
        ->check(CLI::Range(32, 1024));
    app->add_option("--guidance", options->guidance, "editing: folder of the guide (default: the built-in one)");
    app->add_option("--judge", options->judge, "editing: folder of the judge (default: the built-in one)");
    app->add_flag("--resume", options->resume, "go on with the points that the folder holds");
    app->callback(
        [&program, options] { program.action = [&program, options] { run_profile(program.common, *options); }; });
}

}  // namespace fieldgraft::app
