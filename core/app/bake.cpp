// fieldgraft bake FIELD [EDIT…] -o OUT.vdb: density and colour grids for Blender.
#include <memory>

#include "core/app/console.h"
#include "core/app/inputs.h"
#include "vdb_export/vdb_export.h"

namespace fieldgraft::app {
namespace {

struct BakeArguments {
    std::vector<std::string> files;
    std::string output, quality;
    BakeOptions bake;
    bool full_precision = false;
};

void run_bake(const CommonOptions& common, BakeArguments options) {
    const Reporter reporter = console_reporter(common, "bake");
    const FieldWithEdits scene = load_field_and_edits(options.files, reporter);
    options.bake.half_precision = !options.full_precision;
    // Points of the front in docs/accuracy-and-time.md.
    if (!options.quality.empty())
        options.bake.resolution = options.quality == "draft" ? 128 : options.quality == "preview" ? 256 : 384;
    const BakeReport report = bake(*scene.field, scene.edits, options.output, options.bake, reporter);
    print_done(common, {{"voxels", report.voxels},
                        {"bytes", report.bytes},
                        {"seconds", report.seconds},
                        {"voxel_size", report.voxel_size},
                        {"half_precision", report.half_precision},
                        {"path", options.output}});
}

}  // namespace

void add_bake(Program& program) {
    auto options = std::make_shared<BakeArguments>();
    CLI::App* app = program.command("bake", "sample a field, with edits, into an OpenVDB file");
    app->add_option("FILES", options->files, "FIELD [EDIT[:add=X,remove=X,change=X]…]")->required();
    app->add_option("-o,--output", options->output, "OUT.vdb")->required();
    auto* resolution =
        app->add_option("--resolution", options->bake.resolution, "voxels along the longest edge of what there is")
            ->check(CLI::Range(8, 2048));
    auto* voxel_size = app->add_option("--voxel-size", options->bake.voxel_size, "voxel edge in the user's world")
                           ->check(CLI::PositiveNumber)
                           ->excludes(resolution);
    app->add_option("--quality", options->quality, "draft, preview or final: 128, 256 or 384 voxels")
        ->check(CLI::IsMember({"draft", "preview", "final"}))
        ->excludes(resolution)
        ->excludes(voxel_size);
    app->add_option("--threshold", options->bake.threshold,
                    "smallest optical depth that is kept, of 1/256 of the thing's edge")
        ->check(CLI::Range(0.0, 10.0));
    app->add_option("--max-optical-depth", options->bake.max_optical_depth,
                    "cap of a voxel's optical depth, 0 for none")
        ->check(CLI::NonNegativeNumber);
    app->add_option("--supersample", options->bake.supersample, "density samples along each axis of a voxel")
        ->check(CLI::Range(1, 8));
    app->add_flag("--full-precision", options->full_precision, "float32 on disk rather than half");
    app->callback(
        [&program, options] { program.action = [&program, options] { run_bake(program.common, *options); }; });
}

}  // namespace fieldgraft::app
