// What the towers are built of: frozen linear layers, layer norm, multi-head attention, transformer layers.
//
// Tensors are B×L×C (batch, tokens, channels). Attention is softmax(q kᵀ / √(C / heads)) v as plain matrix products: on
// a CPU the backward pass of the fused kernel is slower at these lengths. Under bfloat16 weights, norms and softmax are
// still computed in float32. Differentiable in the input; the weights carry no gradient.
#pragma once

#include <optional>

#include "core/guidance/config.h"
#include "core/guidance/weights.h"

namespace fieldgraft {

struct Linear {
    Tensor weight, bias;  // out×in; bias may be undefined
    static Linear load(const Weights& weights, const std::string& name, int in, int out, bool bias = true);
    Tensor operator()(const Tensor& x) const;
};

struct LayerNorm {
    Tensor weight, bias;  // C, at least float32
    double eps = 1e-5;
    static LayerNorm load(const Weights& weights, const std::string& name, int size, double eps);
    Tensor operator()(const Tensor& x) const;
};

// q: B×Lq×C, k and v: B×Lk×C. causal: a token sees itself and those before it (needs Lq = Lk).
Tensor attention(const Tensor& q, const Tensor& k, const Tensor& v, int heads, bool causal = false);

// quick_gelu: x·sigmoid(1.702 x); gelu (by erf); relu. Throws std::invalid_argument for another name.
Tensor activate(const Tensor& x, const std::string& name);

// One layer with the names layer_norm1/2, self_attn.{q,k,v,out}_proj, mlp.fc1/2. The norm comes before each part, as in
// CLIP's towers (x + f(norm x)), or after it, as in CLIPSeg's decoder (norm(x + f x)).
class TransformerLayer {
  public:
    TransformerLayer(const Weights& weights, const TransformerConfig& config, bool norm_first = true);
    Tensor operator()(const Tensor& x, bool causal = false) const;

  private:
    Tensor attend(const Tensor& x, bool causal) const;
    Tensor feed_forward(const Tensor& x) const;

    int heads_;
    bool norm_first_;
    std::string activation_;
    LayerNorm norm1_, norm2_;
    Linear q_, k_, v_, out_, fc1_, fc2_;
};

}  // namespace fieldgraft
