// fieldgraft.train(): fits a field to a scene.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/train/trainer.h"
#include "python_bindings/bindings.h"
#include "python_bindings/reporting.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

std::shared_ptr<RadianceField> run_training(const Scene& scene, std::optional<double> minutes,
                                            std::optional<std::int64_t> iterations, const std::string& quality,
                                            std::uint64_t seed, const std::optional<std::filesystem::path>& checkpoint,
                                            bool resume, const std::string& precision, const py::object& progress) {
    TrainOptions options;
    options.minutes = minutes;
    options.iterations = iterations;
    options.quality = quality;
    options.seed = seed;
    options.precision = precision;
    return run_reporting(progress, [&](const Reporter& reporter) {
        const TrainResult result = train_field(scene, options, reporter, checkpoint.value_or(""), resume);
        Json done = result.report.to_json();
        done["event"] = "done";
        reporter.event(done);
        return result.field;
    });
}

}  // namespace

void bind_train(py::module_& m) {
    m.def(
        "train", &run_training, py::arg("scene"), py::kw_only(), py::arg("minutes") = py::none(),
        py::arg("iterations") = py::none(), py::arg("quality") = "preview", py::arg("seed") = 0,
        py::arg("checkpoint") = py::none(), py::arg("resume") = false, py::arg("precision") = "bfloat16",
        py::arg("progress") = py::none(),
        "Scene → Field. Trains for minutes, iterations, or a quality's time (draft, preview, final); precision:\n"
        "bfloat16 (of the networks' products, where the machine is fast at it) or float32.\n\n"
        "progress is called with the events of docs/formats.md, the figures last ({'event': 'done', …}); it stops the\n"
        "training by returning False: Cancelled is raised once the checkpoint, if one is named, is written.");
}

}  // namespace fieldgraft
