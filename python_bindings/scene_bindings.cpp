// fieldgraft.Scene and fieldgraft.Camera. Python's cameras stand in the user's world; the scene's frame takes them to
// model coordinates and back.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/base/errors.h"
#include "core/scene/scene.h"
#include "python_bindings/arrays.h"
#include "python_bindings/bindings.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

Mat4 to_matrix(const DoubleArray& array) {
    if (array.ndim() != 2 || array.shape(0) != 4 || array.shape(1) != 4)
        input_error("camera_to_world: expected a 4×4 matrix, got an array of {} dimensions", array.ndim());
    Mat4 out;
    std::copy_n(array.data(), 16, out.begin());
    return out;
}

DoubleArray to_matrix_array(const Mat4& matrix) {
    DoubleArray out({4, 4});
    std::copy_n(matrix.begin(), 16, out.mutable_data());
    return out;
}

Camera new_camera(int width, int height, double fx, const DoubleArray& camera_to_world, std::optional<double> fy,
                  std::optional<double> cx, std::optional<double> cy, std::string name) {
    Camera camera;
    camera.name = std::move(name);
    camera.width = width;
    camera.height = height;
    camera.fx = fx;
    camera.fy = fy.value_or(fx);
    camera.cx = cx.value_or(width / 2.0);
    camera.cy = cy.value_or(height / 2.0);
    camera.camera_to_world = to_matrix(camera_to_world);
    check_camera(camera);
    return camera;
}

std::vector<Camera> world_cameras(const Scene& scene, const std::string& split) {
    std::vector<Camera> cameras = scene.cameras(split);
    for (Camera& camera : cameras) camera = transformed(camera, scene.frame().inverse());
    return cameras;
}

}  // namespace

void bind_scene(py::module_& m) {
    py::class_<Camera>(m, "Camera")
        .def(py::init(&new_camera), py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("camera_to_world"),
             py::arg("fy") = py::none(), py::arg("cx") = py::none(), py::arg("cy") = py::none(), py::arg("name") = "",
             "A pinhole camera: pixels, and a 4×4 pose in the user's world (+X right, +Y up, looks along −Z).")
        .def_readonly("name", &Camera::name)
        .def_readonly("width", &Camera::width)
        .def_readonly("height", &Camera::height)
        .def_readonly("fx", &Camera::fx)
        .def_readonly("fy", &Camera::fy)
        .def_readonly("cx", &Camera::cx)
        .def_readonly("cy", &Camera::cy)
        .def_property_readonly("camera_to_world",
                               [](const Camera& self) { return to_matrix_array(self.camera_to_world); })
        .def(
            "resized", [](const Camera& self, int width, int height) { return resized(self, width, height); },
            py::arg("width"), py::arg("height"), "The same view with another number of pixels.");

    py::class_<Scene, std::shared_ptr<Scene>>(m, "Scene")
        .def_static(
            "load",
            [](const std::filesystem::path& path, std::vector<std::string> splits, double downscale) {
                SceneOptions options;
                options.splits = std::move(splits);
                options.downscale = downscale;
                const py::gil_scoped_release release;
                return std::make_shared<Scene>(Scene::load(path, options));
            },
            py::arg("path"), py::arg("splits") = std::vector<std::string>(), py::arg("downscale") = 1.0,
            "Reads a folder or a transforms*.json: NeRF-synthetic, nerfstudio, instant-ngp.")
        .def_property_readonly("name", &Scene::name)
        .def_property_readonly("warnings", &Scene::warnings)
        .def("cameras", &world_cameras, py::arg("split") = "train", "The split's cameras, in the user's world.")
        .def(
            "image",
            [](const Scene& self, const std::string& name, const std::string& split) {
                return to_array(self.image(self.view(name, split)));
            },
            py::arg("name"), py::arg("split") = "", "H×W×3 or H×W×4 (straight alpha) float32 in [0, 1].");
}

}  // namespace fieldgraft
