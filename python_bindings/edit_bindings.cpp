// fieldgraft._core.train_edit(): what fieldgraft.edit() calls with its arguments as an edit specification.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/edit/edit_loop.h"
#include "python_bindings/bindings.h"
#include "python_bindings/reporting.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

std::shared_ptr<EditFile> run_edit(const std::shared_ptr<RadianceField>& field, const std::vector<EditFile>& below,
                                   const std::shared_ptr<Guidance>& guide, const std::shared_ptr<Scene>& scene,
                                   const py::dict& specification,
                                   const std::optional<std::filesystem::path>& checkpoint, bool resume,
                                   const std::optional<std::filesystem::path>& preview, const py::object& progress) {
    const EditSpec spec = EditSpec::from_json(from_python(specification));
    EditRunOptions options;
    options.checkpoint = checkpoint.value_or("");
    options.resume = resume;
    options.preview = preview.value_or("");
    const EditInputs inputs{field, below, guide, scene.get()};
    return run_reporting(progress, [&](const Reporter& reporter) {
        const EditResult result = train_edit(inputs, spec, options, reporter);
        Json done = result.report.to_json();
        done["event"] = "done";
        reporter.event(done);
        return std::make_shared<EditFile>(result.edit);
    });
}

}  // namespace

void bind_edit(py::module_& m) {
    m.def("train_edit", &run_edit, py::arg("field"), py::arg("below"), py::arg("guide"), py::arg("scene").none(true),
          py::arg("specification"), py::arg("checkpoint"), py::arg("resume"), py::arg("preview"), py::arg("progress"));
    m.def(
        "load_guide",
        [](const std::filesystem::path& folder, const std::optional<std::filesystem::path>& segmenter) {
            const py::gil_scoped_release release;
            return Guidance::load(folder, segmenter.value_or(""), {.image_type = fastest_image_type()});
        },
        py::arg("folder"), py::arg("segmenter"));
}

}  // namespace fieldgraft
