#include <algorithm>

#include "core/base/errors.h"
#include "core/guidance/vision_tower.h"

namespace fieldgraft {

FoldedConv FoldedConv::load(const Weights& weights, const std::string& conv, const std::string& norm, int in, int out,
                            int kernel, int stride) {
    const Weights exact = weights.as(torch::kDouble);
    const Tensor weight = exact.take(conv + ".weight", {out, in, kernel, kernel});
    const Tensor scale = exact.take(norm + ".weight", {out}) / (exact.take(norm + ".running_var", {out}) + 1e-5).sqrt();
    const Tensor bias = exact.take(norm + ".bias", {out}) - exact.take(norm + ".running_mean", {out}) * scale;
    return {(weight * scale.view({-1, 1, 1, 1})).to(weights.type()), bias.to(weights.type()), stride, kernel / 2};
}

Tensor FoldedConv::operator()(const Tensor& x) const {
    return at::conv2d(x, weight, bias, stride, padding);
}

Tensor ModifiedResNet::Bottleneck::operator()(const Tensor& x) const {
    Tensor inner = at::relu(conv2(at::relu(conv1(x))));
    Tensor outer = x;
    // Average pooling where a plain ResNet would stride: no pixel is dropped.
    if (stride > 1) {
        inner = at::avg_pool2d(inner, stride);
        outer = at::avg_pool2d(outer, stride);
    }
    if (shortcut.weight.defined()) outer = shortcut(outer);
    return at::relu(conv3(inner) + outer);
}

ModifiedResNet::Bottleneck ModifiedResNet::load_block(const Weights& weights, int in, int planes, int stride) {
    Bottleneck out;
    out.conv1 = FoldedConv::load(weights, "conv1", "bn1", in, planes, 1);
    out.conv2 = FoldedConv::load(weights, "conv2", "bn2", planes, planes, 3);
    out.conv3 = FoldedConv::load(weights, "conv3", "bn3", planes, planes * 4, 1);
    if (stride > 1 || in != planes * 4)
        out.shortcut = FoldedConv::load(weights, "downsample.0", "downsample.1", in, planes * 4, 1);
    out.stride = stride;
    return out;
}

ModifiedResNet::ModifiedResNet(const Weights& weights, const VisionConfig& config, int projection_dim)
    : stem_pool_(config.stem_pool), heads_(config.num_attention_heads) {
    const Weights in = weights.below("visual.");
    const int width = config.width, deepest = width * 32;
    stem_.push_back(FoldedConv::load(in, "conv1", "bn1", 3, width / 2, 3, 2));
    stem_.push_back(FoldedConv::load(in, "conv2", "bn2", width / 2, width / 2, 3));
    stem_.push_back(FoldedConv::load(in, "conv3", "bn3", width / 2, width, 3));
    int channels = width;
    for (int stage = 0; stage < 4; ++stage) {
        const int planes = width << stage;
        for (int i = 0; i < config.layers[stage]; ++i) {
            const Weights block = in.below(fmt::format("layer{}.{}.", stage + 1, i));
            blocks_[stage].push_back(load_block(block, channels, planes, i == 0 && stage > 0 ? 2 : 1));
            channels = planes * 4;
        }
    }
    const int side = config.image_size / (config.stem_pool ? 32 : 16);
    const Weights pool = in.below("attnpool.");
    positions_ = pool.take("positional_embedding", {1 + side * side, deepest});
    q_ = Linear::load(pool, "q_proj", deepest, deepest);
    k_ = Linear::load(pool, "k_proj", deepest, deepest);
    v_ = Linear::load(pool, "v_proj", deepest, deepest);
    c_ = Linear::load(pool, "c_proj", deepest, projection_dim);
}

std::vector<Tensor> ModifiedResNet::stages(const Tensor& pixels, int last) const {
    Tensor x = pixels.to(positions_.scalar_type());
    for (const FoldedConv& conv : stem_) x = at::relu(conv(x));
    std::vector<Tensor> out{x};
    if (stem_pool_) x = at::avg_pool2d(x, 2);
    for (int stage = 0; stage < last; ++stage) {
        for (const Bottleneck& block : blocks_.at(stage)) x = block(x);
        out.push_back(x);
    }
    return out;
}

// The mean over positions asks, all positions and the mean answer.
Tensor ModifiedResNet::pool(const Tensor& x) const {
    const Tensor flat = x.flatten(2).transpose(1, 2);  // N×HW×C
    const Tensor tokens = at::cat({flat.mean(1, true), flat}, 1) + positions_;
    const Tensor first = tokens.narrow(1, 0, 1);
    return c_(attention(q_(first), k_(tokens), v_(tokens), heads_)).squeeze(1);
}

Tensor ModifiedResNet::embed(const Tensor& pixels) const {
    const Tensor out = pool(stages(pixels, 4).back());
    return out.scalar_type() == torch::kDouble ? out : out.to(torch::kFloat);
}

std::vector<Tensor> ModifiedResNet::activations(const Tensor& pixels, const std::vector<int>& taps) const {
    if (taps.empty()) return {};
    const std::vector<Tensor> all = stages(pixels, *std::ranges::max_element(taps));
    std::vector<Tensor> out;
    for (const int tap : taps) out.push_back(all.at(tap));
    return out;
}

}  // namespace fieldgraft
