// fieldgraft.blend: the engine's own blended compositing on rays of equally many samples. Arrays N×K (colours N×K×3).
#include <pybind11/stl.h>

#include <optional>

#include "core/base/errors.h"
#include "core/render/blend.h"
#include "python_bindings/arrays.h"
#include "python_bindings/bindings.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

using Optional = std::optional<FloatArray>;

// N×K or N×K×3 → N·K or N·K×3; throws naming the argument and its shape.
Tensor flattened(const FloatArray& array, const char* name, py::ssize_t rays, py::ssize_t samples, bool color) {
    const py::ssize_t dims = color ? 3 : 2;
    if (array.ndim() != dims || array.shape(0) != rays || array.shape(1) != samples || (color && array.shape(2) != 3))
        input_error("blend: {} must be {}×{}{}, got {} dimensions of {} values", name, rays, samples, color ? "×3" : "",
                    array.ndim(), array.size());
    const Tensor tensor = to_tensor(array);
    return color ? tensor.reshape({rays * samples, 3}) : tensor.reshape({rays * samples});
}

template <class Choice>
Choice choose(const std::string& value, const char* name, const char* first, Choice a, const char* second, Choice b) {
    if (value == first) return a;
    if (value == second) return b;
    input_error("blend: {} is \"{}\"; it can be \"{}\" or \"{}\"", name, value, first, second);
}

py::dict blend_arrays(const FloatArray& density_o, const FloatArray& color_o, const FloatArray& delta,
                      const Optional& density_e, const Optional& color_e, const Optional& beta_density,
                      const Optional& beta_color, const std::string& compositing, const std::string& removed) {
    if (density_o.ndim() != 2) input_error("blend: density_o must be N×K, got {} dimensions", density_o.ndim());
    const py::ssize_t rays = density_o.shape(0), samples = density_o.shape(1);
    const auto plain = [&](const FloatArray& array, const char* name) {
        return flattened(array, name, rays, samples, false);
    };
    const auto maybe = [&](const Optional& array, const char* name, bool color) {
        return array ? flattened(*array, name, rays, samples, color) : Tensor();
    };
    if ((density_e || beta_color) && !color_e) input_error("blend: density_e and beta_color need color_e");
    const EditSamples edit{maybe(density_e, "density_e", false), maybe(color_e, "color_e", true),
                           maybe(beta_density, "beta_density", false), maybe(beta_color, "beta_color", false)};
    const BlendOptions options{
        choose(compositing, "compositing", "paper", Compositing::paper, "conserving", Compositing::conserving),
        choose(removed, "removed", "paper", RemovedMap::paper, "visible", RemovedMap::visible)};
    const Tensor start = torch::arange(rays + 1, torch::kLong) * samples;
    const torch::NoGradGuard no_grad;
    const Tensor lengths = plain(delta, "delta"), density = plain(density_o, "density_o");
    const Tensor color = flattened(color_o, "color_o", rays, samples, true);
    const bool edited = density_e || beta_density || beta_color;
    BlendOut out;
    if (edited) {
        out = blend(start, lengths, density, color, edit, options);
    } else {
        const CompositeOut base = composite(start, lengths, lengths, density, color);
        out.color = base.color;
        out.transmittance = base.transmittance;
    }
    py::dict result;
    const auto put = [&](const char* name, const Tensor& value, at::IntArrayRef shape) {
        result[name] = to_array(value.defined() ? value : torch::zeros(shape));
    };
    put("color", out.color, {rays, 3});
    put("color_edit", out.color_edit, {rays, 3});
    put("added", out.added, {rays});
    put("removed", out.removed, {rays});
    put("changed", out.changed, {rays});
    put("transmittance", out.transmittance, {rays});
    return result;
}

}  // namespace

void bind_blend(py::module_& m) {
    m.def("blend", &blend_arrays, py::arg("density_o"), py::arg("color_o"), py::arg("delta"),
          py::arg("density_e") = py::none(), py::arg("color_e") = py::none(), py::arg("beta_density") = py::none(),
          py::arg("beta_color") = py::none(), py::arg("compositing") = "paper", py::arg("removed") = "paper",
          "Blended compositing of N rays with K samples → dict: color, color_edit (N×3), added, removed, changed, "
          "transmittance (N). Maps of operations that are off are 0.");
}

}  // namespace fieldgraft
