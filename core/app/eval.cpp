// fieldgraft eval FIELD [EDIT…] --scene SCENE --split S: PSNR and SSIM of a field, or what its edits changed.
#include <cmath>
#include <memory>

#include "core/app/views.h"
#include "core/base/errors.h"
#include "core/base/image.h"
#include "core/edit/metrics.h"
#include "core/render/image_metrics.h"

namespace fieldgraft::app {
namespace {

struct EvalArguments {
    std::vector<std::string> files, views, region_masks;
    std::string scene, split = "test", judge, source, target;
    PictureOptions picture;
};

Tensor truth(const Scene& scene, const View& view, const Tensor& background, const Camera& size) {
    const Tensor image = over_background(scene.image(view), background);
    if (image.size(0) == size.height && image.size(1) == size.width) return image;
    return resize_image(image, size.height, size.width);
}

// The mask of a view that the user drew, H×W bool; undefined when there is none for it.
Tensor region_of(const std::vector<NamedFile>& masks, const Camera& camera) {
    for (const NamedFile& mask : masks) {
        if (mask.view != camera.name) continue;
        const Tensor image = read_image(mask.file);
        if (image.size(0) != camera.height || image.size(1) != camera.width)
            input_error("--region-mask {}: {}×{} pixels, but view {} has {}×{}", mask.file, image.size(1),
                        image.size(0), mask.view, camera.width, camera.height);
        return image.slice(2, 0, 3).mean(2) > 0.5;
    }
    return {};
}

void report_progress(const Reporter& reporter, std::size_t done, std::size_t all, const Stopwatch& watch) {
    if (reporter.stop_requested()) throw Cancelled();
    const double left = watch.seconds() / static_cast<double>(done) * static_cast<double>(all - done);
    reporter.event({{"event", "progress"}, {"iteration", done}, {"total", all}, {"eta_s", left}});
}

// PSNR of a split is the mean over its views, as the literature reports it.
Json evaluate_field(const FieldWithEdits& base, const Scene& scene, const std::vector<View>& views,
                    const EvalArguments& options, const Reporter& reporter) {
    const FieldWithEdits field{base.field, {}};
    double psnr_sum = 0, ssim_sum = 0, seconds = 0;
    const Tensor background = background_color(options.picture.background, field.field->geometry());
    const Stopwatch watch;
    for (std::size_t i = 0; i < views.size(); ++i) {
        const Stopwatch drawing;
        const Tensor image = with_background(draw_picture(field, views[i].camera, options.picture), background);
        seconds += drawing.seconds();
        const Tensor drawn = image.clamp(0, 1);
        const Tensor expected = truth(scene, views[i], background, scaled(views[i].camera, options.picture.scale));
        psnr_sum += psnr(drawn, expected);
        ssim_sum += ssim(drawn, expected);
        report_progress(reporter, i + 1, views.size(), watch);
    }
    const auto count = static_cast<double>(views.size());
    return {{"psnr", psnr_sum / count},
            {"ssim", ssim_sum / count},
            {"seconds_per_view", seconds / count},
            {"views", views.size()}};
}

Json evaluate_edits(const FieldWithEdits& scene, const std::vector<View>& views, const EvalArguments& options,
                    const Reporter& reporter) {
    std::vector<NamedFile> masks;
    for (const std::string& argument : options.region_masks)
        masks.push_back(parse_view_file(argument, "--region-mask"));
    const FieldWithEdits plain{scene.field, {}};
    const Tensor background = background_color(options.picture.background, scene.field->geometry());
    std::vector<EditedView> pairs;
    const Stopwatch watch;
    for (const View& view : views) {
        const Picture before = draw_picture(plain, view.camera, options.picture);
        const Picture after = draw_picture(scene, view.camera, options.picture);
        EditedView pair{with_background(before, background).clamp(0, 1), with_background(after, background).clamp(0, 1),
                        before.alpha > 0.5, region_of(masks, scaled(view.camera, options.picture.scale))};
        if (masks.empty() || pair.region.defined()) pairs.push_back(std::move(pair));
        report_progress(reporter, &view - views.data() + 1, views.size(), watch);
    }
    if (pairs.empty()) input_error("--region-mask: none of the views it names is among those evaluated");
    const Json& specification = scene.edits.back().specification;
    const auto prompt = [&](const std::string& given, const char* key) {
        return given.empty() && specification.is_object() ? specification.value(key, std::string()) : given;
    };
    const std::string source = prompt(options.source, "source"), target = prompt(options.target, "target");
    std::shared_ptr<Guidance> judge;
    if (!source.empty() && !target.empty())
        judge = Guidance::load(options.judge.empty() ? builtin_model("judge") : std::filesystem::path(options.judge));
    return measure_edit(pairs, judge.get(), source, target).to_json();
}

void run_eval(const CommonOptions& common, const EvalArguments& options) {
    if (options.picture.background == "transparent")
        input_error("--background transparent: pictures are compared over white or black");
    const Reporter reporter = console_reporter(common, "eval");
    const FieldWithEdits fields = load_field_and_edits(options.files, reporter);
    const Scene scene = load_scene_of(*fields.field, options.scene, {options.split}, reporter);
    const std::vector<View> views = select_views(scene, options.split, options.views);
    Json figures = evaluate_field(fields, scene, views, options, reporter);
    if (!fields.edits.empty()) figures.update(evaluate_edits(fields, views, options, reporter));
    print_done(common, figures);
}

}  // namespace

void add_eval(Program& program) {
    auto options = std::make_shared<EvalArguments>();
    CLI::App* app = program.command("eval", "measure a field against its scene, and what edits changed");
    app->add_option("FILES", options->files, "FIELD [EDIT[:add=X,remove=X,change=X]…]")->required();
    app->add_option("--scene", options->scene, "the scene to compare with")->required();
    app->add_option("--split", options->split, "train, val or test");
    app->add_option("--views", options->views, "only these views of the split")->delimiter(',');
    app->add_option("--judge", options->judge, "guidance model for S_CLIP and MP_CLIP (default: the built-in judge)");
    app->add_option("--source", options->source, "source prompt (default: the last edit's)");
    app->add_option("--target", options->target, "target prompt (default: the last edit's)");
    app->add_option("--region-mask", options->region_masks, "VIEW:FILE, white where the edit should act (repeatable)");
    add_picture_flags(app, options->picture);
    app->callback(
        [&program, options] { program.action = [&program, options] { run_eval(program.common, *options); }; });
}

}  // namespace fieldgraft::app
