#include "core/guidance/text_tower.h"

#include <algorithm>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

TextTower::TextTower(const Weights& weights, const TextConfig& config, int projection_dim)
    : max_length_(config.max_position_embeddings), vocab_size_(config.vocab_size) {
    const Weights in = weights.below("text_model.");
    const int width = config.hidden_size;
    tokens_ = in.take("embeddings.token_embedding.weight", {config.vocab_size, width});
    positions_ = in.take("embeddings.position_embedding.weight", {max_length_, width});
    for (int i = 0; i < config.num_hidden_layers; ++i)
        layers_.emplace_back(in.below(fmt::format("encoder.layers.{}.", i)), config);
    norm_ = LayerNorm::load(in, "final_layer_norm", width, config.layer_norm_eps);
    projection_ = Linear::load(weights, "text_projection", width, projection_dim, false);
}

Tensor TextTower::encode(const std::vector<std::vector<std::int64_t>>& ids, std::int64_t end_id) const {
    if (ids.empty()) throw std::invalid_argument("TextTower::encode: no texts");
    std::size_t length = 0;
    for (const auto& text : ids) length = std::max(length, text.size());
    if (length > static_cast<std::size_t>(max_length_))
        throw std::invalid_argument(fmt::format("TextTower::encode: {} tokens, at most {}", length, max_length_));

    // Shorter texts are filled up with end tokens: under the causal mask nothing before them sees them.
    const auto count = static_cast<std::int64_t>(ids.size());
    Tensor table = at::full({count, static_cast<std::int64_t>(length)}, end_id, torch::kLong);
    std::vector<std::int64_t> ends;
    for (std::int64_t n = 0; n < count; ++n) {
        const auto& text = ids[n];
        for (const std::int64_t id : text)
            if (id < 0 || id >= vocab_size_)
                throw std::invalid_argument(
                    fmt::format("TextTower::encode: token {} outside 0 … {}", id, vocab_size_ - 1));
        const auto end = std::ranges::find(text, end_id);
        if (end == text.end()) throw std::invalid_argument(fmt::format("TextTower::encode: no end token {}", end_id));
        ends.push_back(end - text.begin());
        std::ranges::copy(text, table[n].data_ptr<std::int64_t>());
    }
    Tensor x = at::embedding(tokens_, table.to(tokens_.device())) + positions_.narrow(0, 0, table.size(1));  // N×L×C
    for (const TransformerLayer& layer : layers_) x = layer(x, true);
    const Tensor rows = at::arange(count, table.options()).to(x.device());
    const Tensor at_end = x.index({rows, at::tensor(ends, torch::kLong).to(x.device())});  // N×C
    return projection_(norm_(at_end));
}

}  // namespace fieldgraft
