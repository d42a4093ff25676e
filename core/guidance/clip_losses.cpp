#include "core/guidance/clip_losses.h"

#include <spdlog/fmt/ranges.h>

#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {
namespace {

std::string shape(const Tensor& x) {
    return fmt::format("[{}]", fmt::join(x.sizes(), ", "));
}

void check_pair(const Tensor& images, const Tensor& text, const char* who) {
    if (images.dim() != 2 || images.size(0) < 1 || text.dim() != 1 || text.size(0) != images.size(1))
        throw std::invalid_argument(
            fmt::format("{}: images must be N×D and the text D, not {} and {}", who, shape(images), shape(text)));
}

}  // namespace

Tensor soft_norm(const Tensor& v, double epsilon) {
    if (!(epsilon > 0)) throw std::invalid_argument(fmt::format("soft_norm: epsilon is {}, must be above 0", epsilon));
    return (v.square().sum(-1, true) + epsilon * epsilon).sqrt();
}

Tensor to_unit(const Tensor& v) {
    return v / soft_norm(v, 1e-12);
}

Tensor soft_cosine(const Tensor& a, const Tensor& b, double epsilon) {
    return ((a / soft_norm(a, epsilon)) * (b / soft_norm(b, epsilon))).sum(-1);
}

Tensor mean_text(const Tensor& texts) {
    if (texts.dim() != 2 || texts.size(0) < 1)
        throw std::invalid_argument(fmt::format("mean_text: texts must be M×D, not {}", shape(texts)));
    return to_unit(to_unit(texts).mean(0));
}

Tensor global_loss(const Tensor& images, const Tensor& text) {
    check_pair(images, text, "global_loss");
    return (1.0 - at::matmul(to_unit(images), to_unit(text))).mean();
}

Tensor directional_loss(const Tensor& before, const Tensor& after, const Tensor& source, const Tensor& target,
                        double epsilon) {
    check_pair(before, source, "directional_loss");
    check_pair(after, target, "directional_loss");
    if (before.sizes() != after.sizes())
        throw std::invalid_argument(
            fmt::format("directional_loss: before is {}, after {}", shape(before), shape(after)));
    const Tensor direction = to_unit(target) - to_unit(source);
    if (direction.norm().item<double>() < 1e-5)
        input_error(
            "the source text and the target text are the same to the model: there is no direction between them");
    // The text's direction is a constant of ordinary length: only the picture's difference needs the soft norm.
    const Tensor moved = to_unit(after) - to_unit(before);
    return (1.0 - at::matmul(moved / soft_norm(moved, epsilon), direction / direction.norm())).mean();
}

}  // namespace fieldgraft
