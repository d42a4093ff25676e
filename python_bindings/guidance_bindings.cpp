// fieldgraft.Guidance and fieldgraft.Tokenizer. Images are N×H×W×3 (or one H×W×3) float32 in [0, 1]; no gradients.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/base/errors.h"
#include "core/guidance/guidance.h"
#include "core/guidance/tokenizer.h"
#include "python_bindings/arrays.h"
#include "python_bindings/bindings.h"

namespace py = pybind11;

namespace fieldgraft {
namespace {

Tensor to_images(const FloatArray& array) {
    Tensor images = to_tensor(array);
    if (images.dim() == 3) images = images.unsqueeze(0);
    if (images.dim() != 4 || images.size(3) != 3)
        throw std::invalid_argument(fmt::format("images must be N×H×W×3, got {} dimensions", array.ndim()));
    return images.permute({0, 3, 1, 2}).contiguous();
}

std::vector<std::string> to_texts(const std::variant<std::string, std::vector<std::string>>& text) {
    if (const auto* one = std::get_if<std::string>(&text)) return {*one};
    return std::get<std::vector<std::string>>(text);
}

// Runs without the interpreter's lock and without a graph.
template <class Work>
FloatArray compute(Work work) {
    Tensor out;
    {
        const py::gil_scoped_release release;
        const torch::NoGradGuard no_grad;
        out = work();
    }
    return to_array(out);
}

std::shared_ptr<Guidance> load(const std::filesystem::path& folder,
                               const std::optional<std::filesystem::path>& segmenter, bool bfloat16) {
    const py::gil_scoped_release release;
    return Guidance::load(folder, segmenter.value_or(""), {.image_type = bfloat16 ? torch::kBFloat16 : torch::kFloat});
}

}  // namespace

void bind_guidance(py::module_& m) {
    using Text = std::variant<std::string, std::vector<std::string>>;
    py::class_<Guidance, std::shared_ptr<Guidance>>(m, "Guidance")
        .def_static("load", &load, py::arg("folder"), py::arg("segmenter") = py::none(), py::arg("bfloat16") = false,
                    "Loads a guidance folder; segmenter: another folder whose segmenter to use.")
        .def(
            "encode_text",
            [](Guidance& self, const Text& texts) {
                return compute([&] { return self.encode_text(to_texts(texts)); });
            },
            py::arg("texts"), "Texts → N×D float32, not normalised.")
        .def(
            "encode_image",
            [](const Guidance& self, const FloatArray& images) {
                const Tensor input = to_images(images);
                return compute([&] { return self.encode_image(input); });
            },
            py::arg("images"), "Images N×H×W×3 in [0, 1] → N×D float32, not normalised.")
        .def(
            "segment",
            [](Guidance& self, const FloatArray& images, const Text& texts) {
                const Tensor input = to_images(images);
                return compute([&] { return self.segment(input, to_texts(texts)); });
            },
            py::arg("images"), py::arg("text"), "Logits N×H×W: one text an image, or one for all.")
        .def("unknown_words", &Guidance::unknown_words, py::arg("text"))
        .def("check_prompts", &Guidance::check_prompts, py::arg("source"), py::arg("target"))
        .def_property_readonly("templates", &Guidance::templates)
        .def_property_readonly("has_segmenter", &Guidance::has_segmenter)
        .def_property_readonly("dimension", [](const Guidance& self) { return self.config().projection_dim; })
        .def_property_readonly("image_size", [](const Guidance& self) { return self.config().preprocess.image_size; })
        .def("hash", &Guidance::hash, py::call_guard<py::gil_scoped_release>());

    py::class_<Tokenizer>(m, "Tokenizer")
        .def_static("load", &Tokenizer::load, py::arg("folder"))
        .def("encode", &Tokenizer::encode, py::arg("text"), py::arg("max_length") = 77)
        .def_static("pieces", &Tokenizer::pieces, py::arg("text"));
}

}  // namespace fieldgraft
