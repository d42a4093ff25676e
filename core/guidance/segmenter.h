// The segmenters' decoders: inner activations of the image tower and a text embedding → logits, h(I, T) of
// Blending-NeRF, sec. 4.3 (a pixel belongs to T where its logit is above that of the text "photo"). Weights under
// "decoder.".
//
//   ClipSegDecoder  CLIPSeg (Lüddecke and Ecker 2022), names of the Hugging Face CLIPSegForImageSegmentation: reduced
//                   activations summed from deep to shallow through post-norm transformer layers, FiLM by the (raw)
//                   text embedding once, transposed convolution to pixels; "refined": the three-step convolution.
//   FilmPyramid     the same with convolutions, for the modified ResNet: 1×1 reduction, bilinear upsampling, FiLM by
//   the
//                   length-1 text embedding at one stage or at all, a residual 3×3 block a stage, a 3×3 head.
//
// Texts N×D pair with images N. Logits are float32 N×h×w at the decoder's own resolution. Differentiable.
#pragma once

#include <memory>
#include <vector>

#include "core/guidance/layers.h"

namespace fieldgraft {

class Segmenter {
  public:
    virtual ~Segmenter() = default;
    // activations: the image tower's, at SegmenterConfig::taps and in that order.
    virtual Tensor decode(const std::vector<Tensor>& activations, const Tensor& text) const = 0;

    static std::unique_ptr<Segmenter> load(const Weights& weights, const GuidanceConfig& config);
};

class ClipSegDecoder : public Segmenter {
  public:
    ClipSegDecoder(const Weights& weights, const GuidanceConfig& config);
    Tensor decode(const std::vector<Tensor>& activations, const Tensor& text) const override;

  private:
    Tensor to_pixels(const Tensor& map) const;

    int conditional_, patch_;
    bool refined_;
    Linear film_mul_, film_add_;
    std::vector<Linear> reduces_;
    std::vector<TransformerLayer> layers_;
    std::vector<Tensor> weights_, biases_;  // of the transposed convolution's steps
};

class FilmPyramid : public Segmenter {
  public:
    FilmPyramid(const Weights& weights, const GuidanceConfig& config);
    Tensor decode(const std::vector<Tensor>& activations, const Tensor& text) const override;

  private:
    struct Conv {
        Tensor weight, bias;
        static Conv load(const Weights& weights, const std::string& name, int in, int out, int kernel);
        Tensor operator()(const Tensor& x) const;
    };
    struct Stage {
        Conv reduce, conv1, conv2;
        Linear film_mul, film_add;  // undefined where the stage has no FiLM
    };
    std::vector<Stage> stages_;  // shallow to deep
    Conv head_;
};

}  // namespace fieldgraft
