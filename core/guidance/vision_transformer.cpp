#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/guidance/vision_tower.h"

namespace fieldgraft {

std::unique_ptr<VisionTower> VisionTower::load(const Weights& weights, const VisionConfig& config, int projection_dim) {
    if (config.trunk == "vit") return std::make_unique<VisionTransformer>(weights, config, projection_dim);
    return std::make_unique<ModifiedResNet>(weights, config, projection_dim);
}

VisionTransformer::VisionTransformer(const Weights& weights, const VisionConfig& config, int projection_dim)
    : patch_(config.patch_size) {
    const Weights in = weights.below("vision_model.");
    const int width = config.hidden_size, grid = config.image_size / config.patch_size;
    class_token_ = in.take("embeddings.class_embedding", {width});
    patch_weight_ = in.take("embeddings.patch_embedding.weight", {width, 3, patch_, patch_});
    positions_ = in.take("embeddings.position_embedding.weight", {1 + grid * grid, width});
    // The name is misspelt in the Hugging Face layout; accept the right spelling too.
    const std::string pre =
        in.has("pre_layrnorm.weight") || !in.has("pre_layernorm.weight") ? "pre_layrnorm" : "pre_layernorm";
    pre_norm_ = LayerNorm::load(in, pre, width, config.layer_norm_eps);
    for (int i = 0; i < config.num_hidden_layers; ++i)
        layers_.emplace_back(in.below(fmt::format("encoder.layers.{}.", i)), config);
    post_norm_ = LayerNorm::load(in, "post_layernorm", width, config.layer_norm_eps);
    projection_ = Linear::load(weights, "visual_projection", width, projection_dim, false);
}

Tensor VisionTransformer::positions(std::int64_t rows, std::int64_t columns) const {
    const std::int64_t patches = positions_.size(0) - 1, width = positions_.size(1);
    const auto grid = static_cast<std::int64_t>(std::lround(std::sqrt(static_cast<double>(patches))));
    if (rows == grid && columns == grid) return positions_;
    Tensor map = positions_.narrow(0, 1, patches).view({1, grid, grid, width}).permute({0, 3, 1, 2});
    // Interpolated in float32 at least: half precision has no bicubic kernel on every device.
    const auto type = map.scalar_type() == torch::kDouble ? torch::kDouble : torch::kFloat;
    map = at::upsample_bicubic2d(map.to(type), {rows, columns}, false).to(positions_.scalar_type());
    return at::cat({positions_.narrow(0, 0, 1), map.permute({0, 2, 3, 1}).reshape({rows * columns, width})});
}

Tensor VisionTransformer::tokens(const Tensor& pixels) const {
    const Tensor patches = at::conv2d(pixels.to(patch_weight_.scalar_type()), patch_weight_, {}, patch_);  // N×C×h×w
    const Tensor first = class_token_.view({1, 1, -1}).expand({pixels.size(0), 1, -1});
    const Tensor x = at::cat({first, patches.flatten(2).transpose(1, 2)}, 1);
    return pre_norm_(x + positions(patches.size(2), patches.size(3)));
}

Tensor VisionTransformer::embed(const Tensor& pixels) const {
    Tensor x = tokens(pixels);
    for (const TransformerLayer& layer : layers_) x = layer(x);
    const Tensor out = projection_(post_norm_(x.select(1, 0)));
    return out.scalar_type() == torch::kDouble ? out : out.to(torch::kFloat);
}

std::vector<Tensor> VisionTransformer::activations(const Tensor& pixels, const std::vector<int>& taps) const {
    std::vector<Tensor> out(taps.size());
    const int last = taps.empty() ? -1 : *std::ranges::max_element(taps);
    Tensor x = tokens(pixels);
    for (int i = 0; i <= last; ++i) {
        x = layers_.at(i)(x);
        for (std::size_t k = 0; k < taps.size(); ++k)
            if (taps[k] == i) out[k] = x;
    }
    return out;
}

}  // namespace fieldgraft
