#include "core/guidance/layers.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

bool is_half(torch::ScalarType type) {
    return type == torch::kBFloat16 || type == torch::kHalf;
}
torch::ScalarType wide(torch::ScalarType type) {
    return is_half(type) ? torch::kFloat : type;
}

}  // namespace

Linear Linear::load(const Weights& weights, const std::string& name, int in, int out, bool bias) {
    return {weights.take(name + ".weight", {out, in}), bias ? weights.take(name + ".bias", {out}) : Tensor()};
}

Tensor Linear::operator()(const Tensor& x) const {
    return bias.defined() ? at::linear(x, weight, bias) : at::linear(x, weight);
}

LayerNorm LayerNorm::load(const Weights& weights, const std::string& name, int size, double eps) {
    const Weights in = weights.as(wide(weights.type()));
    return {in.take(name + ".weight", {size}), in.take(name + ".bias", {size}), eps};
}

Tensor LayerNorm::operator()(const Tensor& x) const {
    return at::layer_norm(x.to(weight.scalar_type()), {x.size(-1)}, weight, bias, eps).to(x.scalar_type());
}

Tensor attention(const Tensor& q, const Tensor& k, const Tensor& v, int heads, bool causal) {
    const auto split = [heads](const Tensor& x) {
        return x.view({x.size(0), x.size(1), heads, x.size(2) / heads}).transpose(1, 2);  // B×heads×L×(C/heads)
    };
    const double scale = 1.0 / std::sqrt(static_cast<double>(q.size(2) / heads));
    Tensor scores = at::matmul(split(q) * scale, split(k).transpose(2, 3));  // B×heads×Lq×Lk
    if (causal) {
        const Tensor later = at::ones({q.size(1), k.size(1)}, scores.options().dtype(torch::kBool)).triu(1);
        scores = scores.masked_fill(later, -std::numeric_limits<double>::infinity());
    }
    const Tensor shares = at::softmax(scores, -1, wide(scores.scalar_type())).to(v.scalar_type());
    return at::matmul(shares, split(v)).transpose(1, 2).reshape({q.size(0), q.size(1), q.size(2)});
}

Tensor activate(const Tensor& x, const std::string& name) {
    if (name == "quick_gelu") return x * at::sigmoid(1.702 * x);
    if (name == "gelu") return at::gelu(x);
    if (name == "relu") return at::relu(x);
    throw std::invalid_argument(fmt::format("activate: '{}' is not quick_gelu, gelu or relu", name));
}

TransformerLayer::TransformerLayer(const Weights& weights, const TransformerConfig& config, bool norm_first)
    : heads_(config.num_attention_heads), norm_first_(norm_first), activation_(config.hidden_act) {
    const int width = config.hidden_size;
    norm1_ = LayerNorm::load(weights, "layer_norm1", width, config.layer_norm_eps);
    norm2_ = LayerNorm::load(weights, "layer_norm2", width, config.layer_norm_eps);
    q_ = Linear::load(weights, "self_attn.q_proj", width, width);
    k_ = Linear::load(weights, "self_attn.k_proj", width, width);
    v_ = Linear::load(weights, "self_attn.v_proj", width, width);
    out_ = Linear::load(weights, "self_attn.out_proj", width, width);
    fc1_ = Linear::load(weights, "mlp.fc1", width, config.intermediate_size);
    fc2_ = Linear::load(weights, "mlp.fc2", config.intermediate_size, width);
}

Tensor TransformerLayer::attend(const Tensor& x, bool causal) const {
    return out_(attention(q_(x), k_(x), v_(x), heads_, causal));
}

Tensor TransformerLayer::feed_forward(const Tensor& x) const {
    return fc2_(activate(fc1_(x), activation_));
}

Tensor TransformerLayer::operator()(const Tensor& x, bool causal) const {
    if (norm_first_) {
        const Tensor attended = x + attend(norm1_(x), causal);
        return attended + feed_forward(norm2_(attended));
    }
    const Tensor attended = norm1_(x + attend(x, causal));
    return norm2_(attended + feed_forward(attended));
}

}  // namespace fieldgraft
