// CLIP's text tower: token and position embedding, a causal transformer, a final norm; the feature of the (first) end
// token goes through the projection (Radford et al. 2021, section 2.4). Names as in the Hugging Face
// CLIPTextModelWithProjection: text_model.…, text_projection.weight. Token ids → N×D float32, not normalised. Frozen;
// ids have no gradient.
#pragma once

#include <vector>

#include "core/guidance/layers.h"

namespace fieldgraft {

class TextTower {
  public:
    TextTower(const Weights& weights, const TextConfig& config, int projection_dim);
    // One list of ids a text, each with an end token and at most max_length() long; lists may differ in length.
    Tensor encode(const std::vector<std::vector<std::int64_t>>& ids, std::int64_t end_id) const;
    int max_length() const { return max_length_; }

  private:
    int max_length_, vocab_size_;
    Tensor tokens_, positions_;  // V×C, L×C
    std::vector<TransformerLayer> layers_;
    LayerNorm norm_;
    Linear projection_;
};

}  // namespace fieldgraft
