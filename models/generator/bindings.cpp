// The Python module scene_generator: thin, no logic. See Generator's documentation string for what a batch holds.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstring>
#include <exception>
#include <stdexcept>
#include <thread>

#include "models/generator/generator.h"
#include "models/generator/shapes.h"

namespace py = pybind11;

namespace fieldgraft::generator {
namespace {

constexpr const char* kGeneratorDoc =
    "Generator(seed, split, size=64, settings=\"\"): pairs of captioned pictures.\n\n"
    "batch(n, threads=1, start=None) -> dict with images uint8 [n,2,S,S,3], captions, change uint8 [n],\n"
    "attributes int16 [n,2,3] (shape, material, colour as far as the caption says them), truth int16 [n,2,3] (the "
    "same\n"
    "whatever the caption says), shares float [n,2,4] (of what is seen of the main object: its share of the picture "
    "and "
    "of all objects; how much of it has its colour, its material), beside uint64 [n,2,3] (bits of the shape, material "
    "and colour words of other clearly visible objects), queries, masks uint8 [n,2,Q,S,S], query_kinds uint8 [n,2,Q], "
    "spec. Without `start` "
    "the\n"
    "batch begins where the last one ended.";

std::vector<PicturePair> make_pairs(const Generator& generator, uint64_t start, int n, int threads) {
    std::vector<PicturePair> pairs(static_cast<size_t>(n));
    std::vector<std::exception_ptr> errors(static_cast<size_t>(threads));
    const auto work = [&](int thread) {
        try {
            for (int i = thread; i < n; i += threads)
                pairs[static_cast<size_t>(i)] = generator.make(start + static_cast<uint64_t>(i));
        } catch (...) {
            errors[static_cast<size_t>(thread)] = std::current_exception();
        }
    };
    std::vector<std::thread> pool;
    for (int t = 1; t < threads; ++t) pool.emplace_back(work, t);
    work(0);
    for (std::thread& t : pool) t.join();
    for (const std::exception_ptr& e : errors) {
        if (e) std::rethrow_exception(e);
    }
    return pairs;
}

py::dict to_dict(const std::vector<PicturePair>& pairs, int size) {
    const auto n = static_cast<py::ssize_t>(pairs.size()), s = static_cast<py::ssize_t>(size),
               q = static_cast<py::ssize_t>(kQueries);
    py::array_t<uint8_t> images({n, py::ssize_t{2}, s, s, py::ssize_t{3}}), masks({n, py::ssize_t{2}, q, s, s}),
        kinds({n, py::ssize_t{2}, q}), change({n});
    py::array_t<int16_t> said({n, py::ssize_t{2}, py::ssize_t{3}}), truth({n, py::ssize_t{2}, py::ssize_t{3}});
    py::array_t<float> shares({n, py::ssize_t{2}, py::ssize_t{4}});
    py::array_t<uint64_t> beside({n, py::ssize_t{2}, py::ssize_t{3}});
    py::list captions, queries, specs;
    for (py::ssize_t i = 0; i < n; ++i) {
        const PicturePair& pair = pairs[static_cast<size_t>(i)];
        change.mutable_at(i) = static_cast<uint8_t>(pair.change);
        py::list both;
        for (py::ssize_t k = 0; k < 2; ++k) {
            const Picture& p = pair.pictures[k];
            std::memcpy(images.mutable_data(i, k, 0, 0, 0), p.frame.pixels.data(), p.frame.pixels.size());
            py::list texts;
            for (py::ssize_t j = 0; j < q; ++j) {
                const Query& query = p.queries.at(static_cast<size_t>(j));
                std::memcpy(masks.mutable_data(i, k, j, 0, 0), query.mask.data(), query.mask.size());
                kinds.mutable_at(i, k, j) = static_cast<uint8_t>(query.kind);
                texts.append(query.text);
            }
            both.append(texts);
            const float four[] = {p.shares.picture, p.shares.objects, p.shares.colour, p.shares.material};
            std::memcpy(shares.mutable_data(i, k, 0), four, sizeof four);
            std::memcpy(beside.mutable_data(i, k, 0), p.beside.data(), sizeof p.beside);
            for (py::ssize_t j = 0; j < 3; ++j) {
                said.mutable_at(i, k, j) = p.said[static_cast<size_t>(j)];
                truth.mutable_at(i, k, j) = p.truth[static_cast<size_t>(j)];
            }
        }
        queries.append(both);
        captions.append(py::make_tuple(pair.pictures[0].caption, pair.pictures[1].caption));
        specs.append(py::make_tuple(pair.pictures[0].spec, pair.pictures[1].spec));
    }
    py::dict batch;
    batch["images"] = images;
    batch["captions"] = captions;
    batch["change"] = change;
    batch["attributes"] = said;
    batch["truth"] = truth;
    batch["shares"] = shares;
    batch["beside"] = beside;
    batch["queries"] = queries;
    batch["masks"] = masks;
    batch["query_kinds"] = kinds;
    batch["spec"] = specs;
    return batch;
}

class PyGenerator {
  public:
    PyGenerator(uint64_t seed, const std::string& split, int size, const std::string& settings)
        : generator_(seed, split, size, settings) {}

    py::dict batch(int n, int threads, const std::optional<uint64_t>& start) {
        if (n < 1) throw std::invalid_argument("Generator.batch: n is " + std::to_string(n) + ", not 1 or more");
        if (threads < 1 || threads > 256)
            throw std::invalid_argument("Generator.batch: threads is " + std::to_string(threads) +
                                        ", not within 1 to 256");
        const uint64_t first = start ? *start : next_;
        std::vector<PicturePair> pairs;
        {
            const py::gil_scoped_release release;
            pairs = make_pairs(generator_, first, n, threads);
        }
        next_ = first + static_cast<uint64_t>(n);
        return to_dict(pairs, generator_.size());
    }

    std::string settings() const { return to_json(generator_.settings()); }

    static py::dict vocabulary() {
        py::list shapes, materials, colours, parts;
        for (int i = 0; i < shape_count(); ++i) shapes.append(std::string(shape_info(i).name));
        for (int i = 0; i < kMaterials; ++i) materials.append(std::string(material_name(i)));
        for (int i = 0; i < kColours; ++i) colours.append(std::string(colour_name(i)));
        for (int i = 0; i < kParts; ++i) parts.append(std::string(part_name(i)));
        py::dict words;
        words["shapes"] = shapes;
        words["materials"] = materials;
        words["colours"] = colours;
        words["parts"] = parts;
        words["additions"] = std::vector<std::string>{"hat", "crown", "ball", "cube", "cone", "flower", "snow", "fire"};
        return words;
    }

  private:
    Generator generator_;
    uint64_t next_ = 0;
};

}  // namespace
}  // namespace fieldgraft::generator

PYBIND11_MODULE(scene_generator, m) {
    using fieldgraft::generator::PyGenerator;
    m.doc() = "Captioned, analytically rendered pictures for training the built-in guidance model.";
    py::class_<PyGenerator>(m, "Generator", fieldgraft::generator::kGeneratorDoc)
        .def(py::init<uint64_t, const std::string&, int, const std::string&>(), py::arg("seed"), py::arg("split"),
             py::arg("size") = 64, py::arg("settings") = "")
        .def("batch", &PyGenerator::batch, py::arg("n"), py::arg("threads") = 1, py::arg("start") = std::nullopt)
        .def("settings", &PyGenerator::settings, "The settings in use, as JSON.")
        .def_static("vocabulary", &PyGenerator::vocabulary);
    m.def("takes_colour", &fieldgraft::generator::takes_colour, py::arg("material"),
          "Whether things of this material are made in a colour of the vocabulary (gold and wood bring their own).");
    m.def("is_held_out", &fieldgraft::generator::is_held_out, py::arg("shape"), py::arg("material"), py::arg("colour"),
          "Whether a (shape, material, colour) combination is kept for the held-out split; colour -1: none.");
}
