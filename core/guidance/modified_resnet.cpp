#include <algorithm>
#include <cmath>

#include "core/base/errors.h"
#include "core/guidance/vision_tower.h"

namespace fieldgraft {

FoldedConv FoldedConv::load(const Weights& weights, const std::string& conv, const std::string& norm, int in, int out,
                            int kernel, int stride) {
    const Weights exact = weights.as(torch::kDouble);
    const Tensor weight = exact.take(conv + ".weight", {out, in, kernel, kernel});
    const Tensor scale = exact.take(norm + ".weight", {out}) / (exact.take(norm + ".running_var", {out}) + 1e-5).sqrt();
    const Tensor bias = exact.take(norm + ".bias", {out}) - exact.take(norm + ".running_mean", {out}) * scale;
    return {(weight * scale.view({-1, 1, 1, 1})).to(weights.type()).contiguous(at::MemoryFormat::ChannelsLast),
            bias.to(weights.type()), stride, kernel / 2};
}

Tensor FoldedConv::operator()(const Tensor& x) const {
    return at::conv2d(x, weight, bias, stride, padding);
}

Tensor ModifiedResNet::Bottleneck::operator()(const Tensor& x) const {
    Tensor inner = conv2(conv1(x).relu_()).relu_();
    Tensor outer = x;
    // Average pooling where a plain ResNet would stride: no pixel is dropped.
    if (stride > 1) {
        inner = at::avg_pool2d(inner, stride);
        outer = at::avg_pool2d(outer, stride);
    }
    if (shortcut.weight.defined()) outer = shortcut(outer);
    return (conv3(inner) + outer).relu_();
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
    const Weights pool = in.below("attnpool.").as(weights.type() == torch::kDouble ? torch::kDouble : torch::kFloat);
    positions_ = pool.take("positional_embedding", {1 + side * side, deepest});
    q_ = Linear::load(pool, "q_proj", deepest, deepest);
    k_ = Linear::load(pool, "k_proj", deepest, deepest);
    v_ = Linear::load(pool, "v_proj", deepest, deepest);
    c_ = Linear::load(pool, "c_proj", deepest, projection_dim);
}

std::vector<Tensor> ModifiedResNet::stages(const Tensor& pixels, int last) const {
    // Channels last: the convolutions' own layout on a CPU, a third faster.
    Tensor x = pixels.to(stem_[0].weight.scalar_type()).contiguous(at::MemoryFormat::ChannelsLast);
    for (const FoldedConv& conv : stem_) x = conv(x).relu_();
    std::vector<Tensor> out{x};
    if (stem_pool_) x = at::avg_pool2d(x, 2);
    for (int stage = 0; stage < last; ++stage) {
        for (const Bottleneck& block : blocks_.at(stage)) x = block(x);
        out.push_back(x);
    }
    return out;
}

// The mean over positions asks, all positions and the mean answer. As there is one question, it goes through the keys'
// weights rather than every token through them (q·(K x) = (Kᵀq)·x; the keys' bias drops out of the softmax), and the
// values' weights are applied to the weighted mean of the tokens: HW times less work than attention as it is written.
Tensor ModifiedResNet::pool(const Tensor& x) const {
    const Tensor flat = x.flatten(2).transpose(1, 2).to(positions_.scalar_type());  // N×HW×C
    const Tensor tokens = at::cat({flat.mean(1, true), flat}, 1) + positions_;      // N×L×C
    const std::int64_t count = x.size(0), width = tokens.size(2), depth = width / heads_;
    const Tensor q = q_(tokens.select(1, 0)).view({count, heads_, depth}).transpose(0, 1);       // H×N×d
    const Tensor asked = at::matmul(q, k_.weight.view({heads_, depth, width})).transpose(0, 1);  // N×H×C
    const Tensor scores = at::matmul(asked, tokens.transpose(1, 2)) / std::sqrt(static_cast<double>(depth));
    const Tensor seen = at::matmul(at::softmax(scores, -1), tokens).transpose(0, 1);                 // H×N×C
    const Tensor values = at::matmul(seen, v_.weight.view({heads_, depth, width}).transpose(1, 2));  // H×N×d
    return c_(values.transpose(0, 1).reshape({count, width}) + v_.bias);
}

Tensor ModifiedResNet::embed(const Tensor& pixels) const {
    return pool(stages(pixels, 4).back());
}

std::vector<Tensor> ModifiedResNet::activations(const Tensor& pixels, const std::vector<int>& taps) const {
    if (taps.empty()) return {};
    const std::vector<Tensor> all = stages(pixels, *std::ranges::max_element(taps));
    std::vector<Tensor> out;
    for (const int tap : taps) out.push_back(all.at(tap));
    return out;
}

}  // namespace fieldgraft
