// fieldgraft.render(): one picture of a field under edits.
#include <pybind11/stl.h>

#include "core/base/errors.h"
#include "core/field/diffuse_color.h"
#include "core/render/blended_view.h"
#include "core/scene/camera.h"
#include "python_bindings/arrays.h"
#include "python_bindings/bindings.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

Tensor with_background(const BlendedRays& drawn, const std::string& background) {
    const Tensor alpha = drawn.alpha.unsqueeze(-1);
    if (background == "transparent") return at::cat({drawn.color / alpha.clamp_min(1e-6), alpha}, -1);
    if (background == "black") return drawn.color;
    if (background != "white") input_error("background: \"{}\" is not white, black or transparent", background);
    return drawn.color + (1 - alpha);
}

BlendedOptions options_of(const RadianceField& field, const std::string& compositing, const std::string& color) {
    if (compositing != "paper" && compositing != "conserving")
        input_error("compositing: \"{}\" is not paper or conserving", compositing);
    if (color != "view" && color != "diffuse") input_error("color: \"{}\" is not view or diffuse", color);
    BlendedOptions options;
    options.blend.compositing = compositing == "paper" ? Compositing::paper : Compositing::conserving;
    options.blend.removed = RemovedMap::visible;
    if (color == "diffuse")
        options.color = [&field](const Tensor& features, const Tensor&, const Tensor&) {
            return diffuse_color(field, features);
        };
    return options;
}

FloatArray render(const RadianceField& field, const std::vector<EditFile>& edits, const Camera& camera, bool maps,
                  const std::string& background, const std::string& compositing, const std::string& color) {
    Tensor image;
    {
        const py::gil_scoped_release release;
        const torch::NoGradGuard no_grad;
        EditStack stack;
        const std::string hash = edits.empty() ? std::string() : field.hash();
        for (const EditFile& edit : edits) {
            edit.check_field(hash, "edits");
            stack.push_back(stack_item(edit));
        }
        const Camera model = transformed(camera, Frame::from_matrix(field.geometry().frame));
        const Rays rays = rays_of_view(model);
        const BlendedRays drawn = render_blended_view(field, stack, {rays.origins, rays.directions}, model.height,
                                                      model.width, options_of(field, compositing, color));
        image = with_background(drawn, background);
        if (maps) image = at::cat({image, at::stack({drawn.added, drawn.removed, drawn.changed}, -1)}, -1);
    }
    return to_array(image);
}

}  // namespace

void bind_render(py::module_& m) {
    m.def("render", &render, py::arg("field"), py::arg("edits"), py::arg("camera"), py::kw_only(),
          py::arg("maps") = false, py::arg("background") = "white", py::arg("compositing") = "paper",
          py::arg("color") = "view",
          "Field, edits (the lowest first), a camera in the user's world → H×W×C float32: RGB, or RGB and straight\n"
          "alpha with background='transparent', then with maps=True also added, removed, changed. Not clamped.");
}

}  // namespace fieldgraft
