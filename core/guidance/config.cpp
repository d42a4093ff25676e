#include "core/guidance/config.h"

#include <algorithm>

#include "core/base/errors.h"
#include "core/guidance/templates.h"

namespace fieldgraft {
namespace {

// CLIP's and ImageNet's channel statistics, as their preprocessors state them.
constexpr std::array<double, 3> clip_mean{0.48145466, 0.4578275, 0.40821073};
constexpr std::array<double, 3> clip_deviation{0.26862954, 0.26130258, 0.27577711};
constexpr std::array<double, 3> imagenet_mean{0.485, 0.456, 0.406};
constexpr std::array<double, 3> imagenet_deviation{0.229, 0.224, 0.225};

// One object of the file, with its place in it for messages.
struct Section {
    Json json;
    std::string where;

    bool has(const std::string& key) const { return json.contains(key) && !json[key].is_null(); }
    template <class T>
    T get(const std::string& key) const {
        if (!has(key)) input_error("{}: \"{}\" is missing", where, key);
        try {
            return json[key].get<T>();
        } catch (const Json::exception&) {
            input_error("{}: \"{}\" has the wrong type: {}", where, key, json[key].dump());
        }
    }
    template <class T>
    T get(const std::string& key, T otherwise) const {
        return has(key) ? get<T>(key) : otherwise;
    }
    int positive(const std::string& key, int otherwise = 0) const {
        const int value = otherwise > 0 ? get<int>(key, otherwise) : get<int>(key);
        if (value < 1 || value > 1 << 24)
            input_error("{}: \"{}\" is {}, must be from 1 to 16777216", where, key, value);
        return value;
    }
    Section section(const std::string& key) const {
        Section out{has(key) ? json[key] : Json::object(), where + ": " + key};
        if (!out.json.is_object()) input_error("{}: \"{}\" must be an object, not {}", where, key, out.json.dump());
        return out;
    }
};

void read_transformer(const Section& in, TransformerConfig& out, const TransformerConfig& otherwise) {
    out.hidden_size = in.positive("hidden_size", otherwise.hidden_size);
    out.intermediate_size = in.positive("intermediate_size", otherwise.intermediate_size);
    out.num_attention_heads = in.positive("num_attention_heads", otherwise.num_attention_heads);
    out.num_hidden_layers = in.positive("num_hidden_layers", otherwise.num_hidden_layers);
    out.hidden_act = in.get<std::string>("hidden_act", otherwise.hidden_act);
    out.layer_norm_eps = in.get<double>("layer_norm_eps", otherwise.layer_norm_eps);
    if (out.hidden_size % out.num_attention_heads != 0)
        input_error("{}: hidden_size {} is no multiple of num_attention_heads {}", in.where, out.hidden_size,
                    out.num_attention_heads);
    if (out.hidden_act != "quick_gelu" && out.hidden_act != "gelu" && out.hidden_act != "relu")
        input_error("{}: hidden_act '{}' is unknown: quick_gelu, gelu or relu", in.where, out.hidden_act);
}

TextConfig read_text(const Section& in) {
    TextConfig out;
    read_transformer(in, out, {512, 2048, 8, 12});
    out.max_position_embeddings = in.positive("max_position_embeddings", 77);
    out.vocab_size = in.positive("vocab_size", 49408);
    if (out.max_position_embeddings < 3)
        input_error("{}: max_position_embeddings {} leaves no room for a word", in.where, out.max_position_embeddings);
    return out;
}

VisionConfig read_vision(const Section& in) {
    VisionConfig out;
    out.trunk = in.get<std::string>("trunk", "vit");
    if (out.trunk == "vit") {
        read_transformer(in, out, {768, 3072, 12, 12});
        out.image_size = in.positive("image_size", 224);
        out.patch_size = in.positive("patch_size", 32);
        if (out.image_size % out.patch_size != 0)
            input_error("{}: image_size {} is no multiple of patch_size {}", in.where, out.image_size, out.patch_size);
        return out;
    }
    if (out.trunk != "modified_resnet")
        input_error("{}: trunk '{}' is unknown: vit or modified_resnet", in.where, out.trunk);
    out.image_size = in.positive("image_size");
    out.width = in.positive("width");
    out.num_attention_heads = in.positive("num_attention_heads");
    out.stem_pool = in.get<bool>("stem_pool", true);
    const auto layers = in.get<std::vector<int>>("layers");
    if (layers.size() != 4 || std::ranges::any_of(layers, [](int n) { return n < 1; }))
        input_error("{}: layers must be four counts from 1 on, not {}", in.where, in.json["layers"].dump());
    std::ranges::copy(layers, out.layers.begin());
    if (out.width % 2 != 0 || out.width * 32 % out.num_attention_heads != 0)
        input_error("{}: width {} must be even, and 32 times it a multiple of num_attention_heads {}", in.where,
                    out.width, out.num_attention_heads);
    const int stride = out.stem_pool ? 32 : 16;
    if (out.image_size % stride != 0)
        input_error("{}: image_size {} is no multiple of {}", in.where, out.image_size, stride);
    return out;
}

std::array<double, 3> read_triple(const Section& in, const std::string& key, const std::array<double, 3>& otherwise) {
    if (!in.has(key)) return otherwise;
    const auto values = in.get<std::vector<double>>(key);
    if (values.size() != 3) input_error("{}: \"{}\" must be three numbers, not {}", in.where, key, in.json[key].dump());
    return {values[0], values[1], values[2]};
}

void read_statistics(const Section& in, Preprocess& out) {
    out.mean = read_triple(in, "image_mean", out.mean);
    out.deviation = read_triple(in, "image_std", out.deviation);
    if (std::ranges::any_of(out.deviation, [](double d) { return !(d > 0); }))
        input_error("{}: image_std must be above 0: {}", in.where, in.json["image_std"].dump());
}

// The Hugging Face layout's preprocessor_config.json: "size" is a number, {shortest_edge} or {height, width}.
void read_preprocessor_file(const std::filesystem::path& folder, Preprocess& out, bool with_size) {
    const auto path = folder / "preprocessor_config.json";
    if (!std::filesystem::exists(path)) return;
    const Section in{read_json(path), path.string()};
    read_statistics(in, out);
    out.bicubic = in.get<int>("resample", out.bicubic ? 3 : 2) == 3;
    if (!with_size || !in.has("size")) return;
    if (in.json["size"].is_object()) {
        const Section size = in.section("size");
        out.image_size = size.positive(size.has("shortest_edge") ? "shortest_edge" : "height");
    } else {
        out.image_size = in.positive("size");
    }
}

SegmenterConfig read_clipseg(const Section& in, const std::filesystem::path& folder, const VisionConfig& vision) {
    SegmenterConfig out;
    out.type = "clipseg";
    out.taps = in.get<std::vector<int>>("extract_layers", {3, 6, 9});
    out.reduce_dim = in.positive("reduce_dim", 64);
    out.conditional = in.get<int>("conditional_layer", 0);
    out.decoder_heads = in.positive("decoder_num_attention_heads", 4);
    out.decoder_intermediate_size = in.positive("decoder_intermediate_size", 2048);
    out.refined = in.get<bool>("use_complex_transposed_convolution", false);
    out.preprocess = {352, imagenet_mean, imagenet_deviation, false};
    read_preprocessor_file(folder, out.preprocess, true);
    if (out.taps.empty() ||
        std::ranges::any_of(out.taps, [&](int i) { return i < 0 || i >= vision.num_hidden_layers; }))
        input_error("{}: extract_layers {} must be from 0 to {}", in.where, Json(out.taps).dump(),
                    vision.num_hidden_layers - 1);
    if (out.preprocess.image_size % vision.patch_size != 0)
        input_error("{}: the segmenter's input size {} is no multiple of patch_size {}", in.where,
                    out.preprocess.image_size, vision.patch_size);
    if (out.reduce_dim % out.decoder_heads != 0)
        input_error("{}: reduce_dim {} is no multiple of decoder_num_attention_heads {}", in.where, out.reduce_dim,
                    out.decoder_heads);
    return out;
}

SegmenterConfig read_film_pyramid(const Section& in, const VisionConfig& vision, const Preprocess& preprocess) {
    SegmenterConfig out;
    out.type = in.get<std::string>("type");
    if (out.type != "film_pyramid") input_error("{}: type '{}' is unknown: film_pyramid", in.where, out.type);
    if (vision.trunk != "modified_resnet") input_error("{}: film_pyramid needs the trunk modified_resnet", in.where);
    out.taps = in.get<std::vector<int>>("stages");
    out.reduce_dim = in.positive("reduce_dim");
    out.conditional = in.get<int>("conditional_stage", -1);
    out.preprocess = preprocess;
    const bool rising = std::ranges::adjacent_find(out.taps, std::greater_equal<>()) == out.taps.end();
    if (out.taps.empty() || !rising || out.taps.front() < 0 || out.taps.back() > 4)
        input_error("{}: stages must be rising numbers from 0 to 4, not {}", in.where, in.json["stages"].dump());
    if (out.conditional >= 0 && std::ranges::find(out.taps, out.conditional) == out.taps.end())
        input_error("{}: conditional_stage {} is not one of the stages {}", in.where, out.conditional,
                    in.json["stages"].dump());
    return out;
}

void read_builtin(const Section& in, GuidanceConfig& out) {
    const Section preprocess = in.section("preprocess");
    out.preprocess = {preprocess.positive("image_size", out.vision.image_size), {0, 0, 0}, {1, 1, 1}, false};
    read_statistics(preprocess, out.preprocess);
    if (out.preprocess.image_size != out.vision.image_size)
        input_error("{}: image_size {} differs from vision_config's {}", preprocess.where, out.preprocess.image_size,
                    out.vision.image_size);
    if (in.has("segmenter_config"))
        out.segmenter = read_film_pyramid(in.section("segmenter_config"), out.vision, out.preprocess);
    const Section colours = in.section("augmentation");
    out.augmentation.brightness = colours.get<double>("brightness", 0.15);
    out.augmentation.contrast = colours.get<double>("contrast", 0.3);
    out.augmentation.saturation = colours.get<double>("saturation", 0.3);
}

}  // namespace

std::vector<int> VisionConfig::channels() const {
    return {width, width * 4, width * 8, width * 16, width * 32};
}

GuidanceConfig load_guidance_config(const std::filesystem::path& folder) {
    const auto path = folder / "config.json";
    if (!std::filesystem::exists(path))
        input_error("{}: no config.json: not a guidance model's folder", folder.string());
    const Section in{read_json(path), path.string()};
    if (!in.json.is_object()) input_error("{}: must be an object", path.string());
    GuidanceConfig out;
    out.model_type = in.get<std::string>("model_type");
    if (out.model_type != "clip" && out.model_type != "clipseg" && out.model_type != "fieldgraft-guidance")
        input_error("{}: model_type '{}' is unknown: clip, clipseg or fieldgraft-guidance", path.string(),
                    out.model_type);
    out.projection_dim = in.positive("projection_dim", 512);
    out.text = read_text(in.section("text_config"));
    out.vision = read_vision(in.section("vision_config"));
    if (out.model_type == "fieldgraft-guidance") {
        read_builtin(in, out);
    } else {
        if (out.vision.trunk != "vit")
            input_error("{}: model_type {} has the trunk vit", path.string(), out.model_type);
        out.preprocess = {out.vision.image_size, clip_mean, clip_deviation, true};
        // CLIPSeg's preprocessor is for its segmenter; the image tower inside it is CLIP's own.
        if (out.model_type == "clip") read_preprocessor_file(folder, out.preprocess, false);
        if (out.model_type == "clipseg") out.segmenter = read_clipseg(in, folder, out.vision);
    }
    out.templates = in.get<std::vector<std::string>>("templates", default_templates());
    if (out.templates.empty()) input_error("{}: templates is empty: at least \"{{}}\"", path.string());
    for (const std::string& text : out.templates) check_template(text, path.string());
    return out;
}

}  // namespace fieldgraft
