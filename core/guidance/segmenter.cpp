#include "core/guidance/segmenter.h"

#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

void check_inputs(const std::vector<Tensor>& activations, std::size_t count, const Tensor& text) {
    if (activations.size() != count)
        throw std::invalid_argument(fmt::format("segmenter: {} activations, expected {}", activations.size(), count));
    if (text.dim() != 2 || text.size(0) != activations[0].size(0))
        throw std::invalid_argument(fmt::format("segmenter: {} images but text embeddings of {} rows, {} dimensions",
                                                activations[0].size(0), text.size(0), text.dim()));
}

}  // namespace

std::unique_ptr<Segmenter> Segmenter::load(const Weights& weights, const GuidanceConfig& config) {
    if (config.segmenter.type == "clipseg") return std::make_unique<ClipSegDecoder>(weights, config);
    if (config.segmenter.type == "film_pyramid") return std::make_unique<FilmPyramid>(weights, config);
    throw std::invalid_argument(fmt::format("Segmenter::load: type '{}'", config.segmenter.type));
}

ClipSegDecoder::ClipSegDecoder(const Weights& weights, const GuidanceConfig& config)
    : conditional_(config.segmenter.conditional), patch_(config.vision.patch_size), refined_(config.segmenter.refined) {
    const Weights in = weights.below("decoder.");
    const int reduced = config.segmenter.reduce_dim;
    film_mul_ = Linear::load(in, "film_mul", config.projection_dim, reduced);
    film_add_ = Linear::load(in, "film_add", config.projection_dim, reduced);
    TransformerConfig layer = config.vision;
    layer.hidden_size = reduced;
    layer.intermediate_size = config.segmenter.decoder_intermediate_size;
    layer.num_attention_heads = config.segmenter.decoder_heads;
    layer.hidden_act = "relu";  // whatever decoder_hidden_act says: so the published weights were trained
    for (std::size_t i = 0; i < config.segmenter.taps.size(); ++i) {
        reduces_.push_back(Linear::load(in, fmt::format("reduces.{}", i), config.vision.hidden_size, reduced));
        layers_.emplace_back(in.below(fmt::format("layers.{}.", i)), layer, false);
    }
    const auto step = [&](const std::string& name, std::vector<std::int64_t> shape, int bias) {
        weights_.push_back(in.take(name + ".weight", std::move(shape)));
        biases_.push_back(in.take(name + ".bias", {bias}));
    };
    if (refined_) {
        const int kernel = patch_ / 4;
        step("transposed_convolution.0", {reduced, reduced, 3, 3}, reduced);
        step("transposed_convolution.2", {reduced, reduced / 2, kernel, kernel}, reduced / 2);
        step("transposed_convolution.4", {reduced / 2, 1, kernel, kernel}, 1);
    } else {
        step("transposed_convolution", {reduced, 1, patch_, patch_}, 1);
    }
}

Tensor ClipSegDecoder::to_pixels(const Tensor& map) const {
    if (!refined_) return at::conv_transpose2d(map, weights_[0], biases_[0], patch_);
    const int kernel = patch_ / 4;
    Tensor x = at::relu(at::conv2d(map, weights_[0], biases_[0], 1, 1));
    x = at::relu(at::conv_transpose2d(x, weights_[1], biases_[1], kernel));
    return at::conv_transpose2d(x, weights_[2], biases_[2], kernel);
}

Tensor ClipSegDecoder::decode(const std::vector<Tensor>& activations, const Tensor& text) const {
    check_inputs(activations, reduces_.size(), text);
    const auto type = film_mul_.weight.scalar_type();
    Tensor x;
    for (std::size_t i = 0; i < reduces_.size(); ++i) {
        const Tensor reduced = reduces_[i](activations[activations.size() - 1 - i].to(type));  // N×L×R
        x = x.defined() ? reduced + x : reduced;
        if (static_cast<int>(i) == conditional_) {
            const Tensor c = text.to(type);
            x = film_mul_(c).unsqueeze(1) * x + film_add_(c).unsqueeze(1);
        }
        x = layers_[i](x);
    }
    const std::int64_t patches = x.size(1) - 1;
    const auto side = static_cast<std::int64_t>(std::lround(std::sqrt(static_cast<double>(patches))));
    const Tensor map = x.narrow(1, 1, patches).transpose(1, 2).reshape({x.size(0), x.size(2), side, side});
    return to_pixels(map).squeeze(1);
}

FilmPyramid::Conv FilmPyramid::Conv::load(const Weights& weights, const std::string& name, int in, int out,
                                          int kernel) {
    return {weights.take(name + ".weight", {out, in, kernel, kernel}), weights.take(name + ".bias", {out})};
}

Tensor FilmPyramid::Conv::operator()(const Tensor& x) const {
    return at::conv2d(x, weight, bias, 1, weight.size(2) / 2);
}

FilmPyramid::FilmPyramid(const Weights& weights, const GuidanceConfig& config) {
    const Weights in = weights.below("decoder.");
    const SegmenterConfig& segmenter = config.segmenter;
    const int reduced = segmenter.reduce_dim;
    for (const int s : segmenter.taps) {
        Stage stage;
        stage.reduce = Conv::load(in, fmt::format("reduces.{}", s), config.vision.channels().at(s), reduced, 1);
        stage.conv1 = Conv::load(in, fmt::format("blocks.{}.conv1", s), reduced, reduced, 3);
        stage.conv2 = Conv::load(in, fmt::format("blocks.{}.conv2", s), reduced, reduced, 3);
        if (segmenter.conditional < 0 || segmenter.conditional == s) {
            const std::string suffix = segmenter.conditional < 0 ? fmt::format(".{}", s) : "";
            stage.film_mul = Linear::load(in, "film_mul" + suffix, config.projection_dim, reduced);
            stage.film_add = Linear::load(in, "film_add" + suffix, config.projection_dim, reduced);
        }
        stages_.push_back(std::move(stage));
    }
    head_ = Conv::load(in, "head", reduced, 1, 3);
}

Tensor FilmPyramid::decode(const std::vector<Tensor>& activations, const Tensor& text) const {
    check_inputs(activations, stages_.size(), text);
    const auto type = head_.weight.scalar_type();
    const Tensor wide = text.to(type);
    const Tensor c = wide / (wide.square().sum(1, true) + 1e-24).sqrt();
    Tensor a;
    for (std::size_t i = stages_.size(); i-- > 0;) {
        const Stage& stage = stages_[i];
        const Tensor x = stage.reduce(activations[i].to(type));  // N×R×h×w
        a = a.defined() ? x + at::upsample_bilinear2d(a, {x.size(2), x.size(3)}, false) : x;
        if (stage.film_mul.weight.defined())
            a = stage.film_mul(c).unsqueeze(2).unsqueeze(3) * a + stage.film_add(c).unsqueeze(2).unsqueeze(3);
        a = at::relu(a + stage.conv2(at::relu(stage.conv1(a))));
    }
    return head_(a).squeeze(1);
}

}  // namespace fieldgraft
