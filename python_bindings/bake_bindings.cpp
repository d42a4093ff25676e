// fieldgraft.bake(): a field under edits as an OpenVDB file.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "python_bindings/bindings.h"
#include "python_bindings/reporting.h"
#include "vdb_export/vdb_export.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

py::dict bake_to_file(const RadianceField& field, const std::vector<EditFile>& edits, const std::filesystem::path& path,
                      int resolution, double voxel_size, bool half_precision, const py::object& progress) {
    BakeOptions options;
    options.resolution = resolution;
    options.voxel_size = voxel_size;
    options.half_precision = half_precision;
    const BakeReport report =
        run_reporting(progress, [&](const Reporter& reporter) { return bake(field, edits, path, options, reporter); });
    py::dict figures;
    figures["voxels"] = report.voxels;
    figures["bytes"] = report.bytes;
    figures["seconds"] = report.seconds;
    figures["voxel_size"] = report.voxel_size;
    return figures;
}

}  // namespace

void bind_bake(py::module_& m) {
    m.def("bake", &bake_to_file, py::arg("field"), py::arg("edits"), py::arg("path"), py::kw_only(),
          py::arg("resolution") = 256, py::arg("voxel_size") = 0.0, py::arg("half_precision") = true,
          py::arg("progress") = py::none(),
          "Writes density and colour grids in the user's world; → {voxels, bytes, seconds, voxel_size}.\n\n"
          "resolution: voxels along the longest edge; voxel_size (user's world), when positive, takes its place.");
}

}  // namespace fieldgraft
