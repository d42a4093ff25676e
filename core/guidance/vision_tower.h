// Image towers: pixels already resized and normalised (N×3×S×S) → embedding N×D (float32, not normalised), or what
// comes out of some inner layers (for the segmenter). Differentiable in the pixels; the weights are frozen.
//
//   VisionTransformer  CLIP's ViT, names as in the Hugging Face CLIPVisionModelWithProjection (vision_model.…,
//                      visual_projection.weight). Taps: the outputs of transformer layers, N×(1+(S/P)²)×C, class token
//                      first. Another S than the model's: the position embedding is interpolated bicubically.
//   ModifiedResNet     CLIP's other trunk (Radford et al. 2021, section 2.4): 3×3 stem, bottlenecks that average-pool
//   instead
//                      of striding, attention pooling; names visual.… as in OpenAI's own files. Batch norms (running
//                      statistics, eps 1e-5) are folded into the convolutions at load, in double. Taps: stage 0 = stem
//                      before its pool, 1–4 = the stages, N×C×H×W.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/guidance/layers.h"

namespace fieldgraft {

class VisionTower {
  public:
    virtual ~VisionTower() = default;
    virtual Tensor embed(const Tensor& pixels) const = 0;
    // In the order of `taps`; nothing deeper than the deepest tap is computed.
    virtual std::vector<Tensor> activations(const Tensor& pixels, const std::vector<int>& taps) const = 0;

    static std::unique_ptr<VisionTower> load(const Weights& weights, const VisionConfig& config, int projection_dim);
};

class VisionTransformer : public VisionTower {
  public:
    VisionTransformer(const Weights& weights, const VisionConfig& config, int projection_dim);
    Tensor embed(const Tensor& pixels) const override;
    std::vector<Tensor> activations(const Tensor& pixels, const std::vector<int>& taps) const override;

  private:
    Tensor tokens(const Tensor& pixels) const;
    Tensor positions(std::int64_t rows, std::int64_t columns) const;

    int patch_;
    Tensor class_token_, patch_weight_, positions_;  // C, C×3×P×P, (1+G²)×C
    LayerNorm pre_norm_, post_norm_;
    std::vector<TransformerLayer> layers_;
    Linear projection_;
};

// A convolution without bias and the batch norm after it, as one convolution.
struct FoldedConv {
    Tensor weight, bias;
    int stride = 1, padding = 0;
    static FoldedConv load(const Weights& weights, const std::string& conv, const std::string& norm, int in, int out,
                           int kernel, int stride = 1);
    Tensor operator()(const Tensor& x) const;
};

class ModifiedResNet : public VisionTower {
  public:
    ModifiedResNet(const Weights& weights, const VisionConfig& config, int projection_dim);
    Tensor embed(const Tensor& pixels) const override;
    std::vector<Tensor> activations(const Tensor& pixels, const std::vector<int>& taps) const override;

  private:
    struct Bottleneck {
        FoldedConv conv1, conv2, conv3, shortcut;
        int stride;
        Tensor operator()(const Tensor& x) const;
    };
    static Bottleneck load_block(const Weights& weights, int in, int planes, int stride);
    // Outputs of stages 0 … last.
    std::vector<Tensor> stages(const Tensor& pixels, int last) const;
    Tensor pool(const Tensor& x) const;

    bool stem_pool_;
    int heads_;
    std::vector<FoldedConv> stem_;
    std::array<std::vector<Bottleneck>, 4> blocks_;
    Tensor positions_;  // (1+HW)×C
    Linear q_, k_, v_, c_;
};

}  // namespace fieldgraft
