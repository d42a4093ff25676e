#include "core/guidance/guidance.h"

#include <ATen/cpu/Utils.h>

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <unordered_map>
#include <unordered_set>

#include "core/base/errors.h"
#include "core/base/files.h"
#include "core/guidance/preprocess.h"
#include "core/guidance/segmenter.h"
#include "core/guidance/text_tower.h"
#include "core/guidance/tokenizer.h"
#include "core/guidance/vision_tower.h"

namespace fieldgraft {
namespace {

std::filesystem::path find_weights(const std::filesystem::path& folder) {
    const auto path = folder / "model.safetensors";
    if (std::filesystem::exists(path)) return path;
    if (std::filesystem::exists(folder / "pytorch_model.bin"))
        input_error(
            "{}: only pytorch_model.bin is there, and pickled files are not opened; convert it with transformers: "
            "from_pretrained(folder).save_pretrained(folder, safe_serialization=True)",
            folder.string());
    input_error("{}: no model.safetensors", folder.string());
}

std::unordered_set<std::string> read_words(const std::filesystem::path& path) {
    std::unordered_set<std::string> out;
    if (!std::filesystem::exists(path)) return out;
    for (std::string& word : Tokenizer::words(read_file(path))) out.insert(std::move(word));
    if (out.empty()) input_error("{}: holds no words: one a line", path.string());
    return out;
}

}  // namespace

struct Guidance::Model {
    GuidanceConfig config;
    std::filesystem::path folder;
    std::shared_ptr<const SafeTensors> file;  // kept for the hash; in float32 it shares the towers' memory
    Tokenizer tokenizer;
    std::unique_ptr<TextTower> text;
    std::unique_ptr<VisionTower> vision;
    std::unique_ptr<Segmenter> segmenter;
    std::unordered_set<std::string> known_words;  // empty: no list
    std::mutex mutex;                             // guards embeddings
    std::unordered_map<std::string, Tensor> embeddings;

    std::vector<std::int64_t> ids(const std::string& text_) const {
        return tokenizer.encode(text_, config.text.max_position_embeddings);
    }
};

torch::ScalarType fastest_image_type() {
    const auto capabilities = at::cpu::get_cpu_capabilities();
    const auto has = [&](const char* name) {
        const auto found = capabilities.find(name);
        return found != capabilities.end() && found->second.isBool() && found->second.toBool();
    };
    return has("avx512_bf16") || has("amx_bf16") ? torch::kBFloat16 : torch::kFloat;
}

Guidance::Guidance() = default;
Guidance::~Guidance() = default;

std::shared_ptr<Guidance::Model> Guidance::load_model(const std::filesystem::path& folder,
                                                      const GuidanceOptions& options) {
    if (!std::filesystem::is_directory(folder))
        input_error("{}: not a folder: a guidance model is one", folder.string());
    GuidanceConfig config = load_guidance_config(folder);
    const auto path = find_weights(folder);
    auto model = std::shared_ptr<Model>(new Model{.config = std::move(config),
                                                  .folder = folder,
                                                  .file = std::make_shared<const SafeTensors>(load_safetensors(path)),
                                                  .tokenizer = Tokenizer::load(folder),
                                                  .text = {},
                                                  .vision = {},
                                                  .segmenter = {},
                                                  .known_words = read_words(folder / "words.txt"),
                                                  .mutex = {},
                                                  .embeddings = {}});
    if (model->tokenizer.largest_id() >= model->config.text.vocab_size)
        input_error("{}: the vocabulary's ids go to {}, text_config's vocab_size is {}", folder.string(),
                    model->tokenizer.largest_id(), model->config.text.vocab_size);
    const Weights whole(model->file, torch::kFloat, options.device);
    const Weights towers = model->config.model_type == "clipseg" ? whole.below("clip.") : whole;
    const int dimension = model->config.projection_dim;
    model->text = std::make_unique<TextTower>(towers, model->config.text, dimension);
    model->vision = VisionTower::load(towers.as(options.image_type), model->config.vision, dimension);
    const bool exact = options.image_type == torch::kDouble;
    if (!model->config.segmenter.type.empty())
        model->segmenter = Segmenter::load(whole.as(exact ? torch::kDouble : torch::kFloat), model->config);
    return model;
}

std::shared_ptr<Guidance> Guidance::load(const std::filesystem::path& folder,
                                         const std::filesystem::path& segmenter_folder,
                                         const GuidanceOptions& options) {
    if (options.image_type != torch::kFloat && options.image_type != torch::kBFloat16 &&
        options.image_type != torch::kDouble)
        throw std::invalid_argument(
            fmt::format("Guidance::load: image_type must be float32, bfloat16 or float64, not {}",
                        c10::toString(options.image_type)));
    std::shared_ptr<Guidance> out(new Guidance);
    out->model_ = load_model(folder, options);
    if (segmenter_folder.empty()) {
        if (out->model_->segmenter) out->segmenter_ = out->model_;
        return out;
    }
    const bool same =
        std::filesystem::exists(segmenter_folder) && std::filesystem::equivalent(folder, segmenter_folder);
    out->segmenter_ = same ? out->model_ : load_model(segmenter_folder, options);
    if (!out->segmenter_->segmenter)
        input_error("{}: this model has no segmenter; give a CLIPSeg folder or the built-in model",
                    segmenter_folder.string());
    return out;
}

Tensor Guidance::encode_text(Model& model, const std::vector<std::string>& texts) {
    if (texts.empty()) throw std::invalid_argument("Guidance::encode_text: no texts");
    const torch::NoGradGuard no_grad;
    const std::scoped_lock lock(model.mutex);
    std::vector<std::string> missing;
    std::vector<std::vector<std::int64_t>> ids;
    for (const std::string& text : texts) {
        if (model.embeddings.contains(text) || std::ranges::find(missing, text) != missing.end()) continue;
        missing.push_back(text);
        ids.push_back(model.ids(text));
    }
    constexpr std::size_t batch = 64;
    for (std::size_t at = 0; at < missing.size(); at += batch) {
        const std::size_t count = std::min(batch, missing.size() - at);
        const Tensor rows = model.text->encode({ids.begin() + at, ids.begin() + at + count}, model.tokenizer.end_id());
        for (std::size_t i = 0; i < count; ++i) model.embeddings[missing[at + i]] = rows[i].clone();
    }
    std::vector<Tensor> out;
    for (const std::string& text : texts) out.push_back(model.embeddings.at(text));
    return at::stack(out);
}

Tensor Guidance::encode_text(const std::vector<std::string>& texts) {
    return encode_text(*model_, texts);
}

Tensor Guidance::encode_image(const Tensor& images) const {
    check_images(images, "Guidance::encode_image");
    return model_->vision->embed(prepare_images(images, model_->config.preprocess));
}

Guidance::Model& Guidance::segmenter() const {
    if (!segmenter_)
        input_error("{}: this model has no segmenter; give one beside it (a CLIPSeg folder or the built-in model)",
                    model_->folder.string());
    return *segmenter_;
}

Tensor Guidance::segment(const Tensor& images, const std::vector<std::string>& texts) {
    check_images(images, "Guidance::segment");
    if (texts.size() != 1 && static_cast<std::int64_t>(texts.size()) != images.size(0))
        throw std::invalid_argument(fmt::format("Guidance::segment: {} texts for {} images: one each, or one for all",
                                                texts.size(), images.size(0)));
    Model& model = segmenter();
    const Tensor text = encode_text(model, texts).expand({images.size(0), -1});
    const Tensor pixels = prepare_images(images, model.config.segmenter.preprocess);
    const Tensor logits = model.segmenter->decode(model.vision->activations(pixels, model.config.segmenter.taps), text);
    return at::upsample_bilinear2d(logits.unsqueeze(1), {images.size(2), images.size(3)}, false).squeeze(1);
}

Tensor Guidance::segment_each(const Tensor& images, const std::vector<std::string>& texts) {
    check_images(images, "Guidance::segment_each");
    Model& model = segmenter();
    const Tensor text = encode_text(model, texts);
    const Tensor pixels = prepare_images(images, model.config.segmenter.preprocess);
    const auto activations = model.vision->activations(pixels, model.config.segmenter.taps);
    std::vector<Tensor> out;
    for (std::int64_t t = 0; t < text.size(0); ++t) {
        const Tensor logits = model.segmenter->decode(activations, text.narrow(0, t, 1).expand({images.size(0), -1}));
        out.push_back(at::upsample_bilinear2d(logits.unsqueeze(1), {images.size(2), images.size(3)}, false));
    }
    return at::cat(out, 1);
}

bool Guidance::has_segmenter() const {
    return segmenter_ != nullptr;
}
const std::vector<std::string>& Guidance::templates() const {
    return model_->config.templates;
}
const GuidanceConfig& Guidance::config() const {
    return model_->config;
}

std::string Guidance::hash() {
    const std::scoped_lock lock(model_->mutex);
    if (!hash_.empty()) return hash_;
    std::map<std::string, Tensor> tensors = model_->file->tensors;
    if (segmenter_ && segmenter_ != model_)
        for (const auto& [name, tensor] : segmenter_->file->tensors) tensors["segmenter/" + name] = tensor;
    return hash_ = content_hash(tensors);
}

std::vector<std::string> Guidance::unknown_words(std::string_view text) const {
    std::vector<std::string> out;
    if (model_->known_words.empty()) return out;
    for (std::string& word : Tokenizer::words(text))
        if (!model_->known_words.contains(word) && std::ranges::find(out, word) == out.end())
            out.push_back(std::move(word));
    return out;
}

void Guidance::check_prompts(const std::string& source, const std::string& target) const {
    for (const auto& [name, text] : {std::pair("source", &source), std::pair("target", &target)})
        if (Tokenizer::pieces(*text).empty()) input_error("the {} text is empty: say in words what it shows", name);
    if (model_->ids(source) == model_->ids(target))
        input_error("the source text '{}' and the target text '{}' are the same to the model: there is nothing to edit",
                    source, target);
}

}  // namespace fieldgraft
