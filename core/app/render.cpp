// fieldgraft render FIELD [EDIT…] --scene SCENE --split S | --cameras PATH.json -o DIR: pictures as PNG and EXR.
#include <memory>

#include "core/app/views.h"
#include "core/base/errors.h"
#include "core/base/image.h"
#include "core/scene/camera_path.h"

namespace fieldgraft::app {
namespace {

struct RenderArguments {
    std::vector<std::string> files, views;
    std::string scene, split = "test", cameras, output;
    PictureOptions picture;
    bool maps = false;
};

std::vector<Camera> cameras_to_render(const RenderArguments& options, const RadianceField& field,
                                      const Reporter& reporter) {
    std::vector<Camera> cameras;
    if (!options.cameras.empty()) {
        const Frame frame = Frame::from_matrix(field.geometry().frame);
        for (const Camera& camera : read_camera_path(options.cameras).cameras)
            cameras.push_back(transformed(camera, frame));
        return cameras;
    }
    if (options.scene.empty())
        input_error("render: no cameras; give --scene SCENE with --split, or --cameras PATH.json");
    const Scene scene = load_scene_of(field, options.scene, {options.split}, reporter);
    for (const View& view : select_views(scene, options.split, options.views)) cameras.push_back(view.camera);
    return cameras;
}

void write_maps(const std::filesystem::path& stem, const FieldWithEdits& scene, const Picture& picture) {
    Operations any;
    for (const EditFile& edit : scene.edits) {
        const Operations& has = edit.field->config().operations;
        any = {any.add || has.add, any.remove || has.remove, any.change || has.change};
    }
    const auto write = [&](bool on, const char* name, const Tensor& map) {
        if (!on) return;
        write_png(stem.string() + "_" + name + ".png", map);
        write_exr(stem.string() + "_" + name + ".exr", map);
    };
    write(any.add, "added", picture.added);
    write(any.remove, "removed", picture.removed);
    write(any.change, "changed", picture.changed);
}

void run_render(const CommonOptions& common, const RenderArguments& options) {
    const Reporter reporter = console_reporter(common, "render");
    const FieldWithEdits scene = load_field_and_edits(options.files, reporter);
    const std::vector<Camera> cameras = cameras_to_render(options, *scene.field, reporter);
    const Tensor background = background_color(options.picture.background, scene.field->geometry());
    const Stopwatch watch;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        if (reporter.stop_requested()) throw Cancelled();
        const Picture picture = draw_picture(scene, cameras[i], options.picture);
        const std::filesystem::path stem = std::filesystem::path(options.output) / cameras[i].name;
        const Tensor image = with_background(picture, background);
        write_png(stem.string() + ".png", image);
        write_exr(stem.string() + ".exr", image);
        if (options.maps) write_maps(stem, scene, picture);
        const double done = static_cast<double>(i + 1), all = static_cast<double>(cameras.size());
        reporter.event({{"event", "progress"},
                        {"iteration", i + 1},
                        {"total", cameras.size()},
                        {"eta_s", watch.seconds() / done * (all - done)}});
    }
    const double seconds = watch.seconds();
    print_done(common, {{"views", cameras.size()},
                        {"seconds", seconds},
                        {"seconds_per_view", seconds / static_cast<double>(std::max<std::size_t>(1, cameras.size()))},
                        {"path", options.output}});
}

}  // namespace

void add_render(Program& program) {
    auto options = std::make_shared<RenderArguments>();
    CLI::App* app = program.command("render", "draw a field, with edits, from a scene's or a path's cameras");
    app->add_option("FILES", options->files, "FIELD [EDIT[:add=X,remove=X,change=X]…]")->required();
    auto* scene = app->add_option("--scene", options->scene, "the scene whose cameras to use");
    app->add_option("--split", options->split, "train, val or test");
    app->add_option("--views", options->views, "only these views of the split")->delimiter(',');
    auto* cameras = app->add_option("--cameras", options->cameras, "a camera path, in the user's world");
    cameras->excludes(scene);
    app->add_option("-o,--output", options->output, "folder for NAME.png and NAME.exr")->required();
    app->add_flag("--maps", options->maps, "also NAME_added, NAME_removed, NAME_changed");
    add_picture_flags(app, options->picture);
    app->callback(
        [&program, options] { program.action = [&program, options] { run_render(program.common, *options); }; });
}

}  // namespace fieldgraft::app
