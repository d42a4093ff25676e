#include "core/edit/losses.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/base/errors.h"

namespace fieldgraft {

namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

void check_map(const Tensor& map, const char* what) {
    if (!map.defined() || map.dim() != 2 || !map.is_floating_point())
        throw std::invalid_argument(fmt::format("{}: an S×S map of floats is expected, not {} dimensions", what,
                                                map.defined() ? map.dim() : 0));
}

void check_mask(const Tensor& mask, const Tensor& map, const char* what) {
    if (!mask.defined() || mask.scalar_type() != at::kBool || mask.sizes() != map.sizes())
        throw std::invalid_argument(
            fmt::format("region_loss: {} must be bool of the map's size {}×{}", what, map.size(0), map.size(1)));
}

// H(z) in bits. The slope log₂((1 − z)/z) is taken at z clamped to [2⁻²⁰, 1 − 2⁻²⁰]: at most 20 in size.
struct BinaryEntropy : torch::autograd::Function<BinaryEntropy> {
    static Tensor forward(AutogradContext* context, const Tensor& z) {
        context->save_for_backward({z});
        const Tensor p = z.clamp(0, 1);
        const Tensor nats = at::xlogy(p, p) + at::special_xlog1py(1 - p, -p);
        return nats * (-1.0 / std::log(2.0));
    }
    static variable_list backward(AutogradContext* context, variable_list gradients) {
        constexpr double edge = 0x1p-20;
        const Tensor p = context->get_saved_variables()[0].clamp(edge, 1 - edge);
        const Tensor slope = (at::log1p(-p) - at::log(p)) * (1.0 / std::log(2.0));
        return {gradients[0] * slope};
    }
};

}  // namespace

double positive_weight(double area, double pixels, double floor) {
    if (!(area >= 0) || !(pixels >= area))
        throw std::invalid_argument(fmt::format("positive_weight: area {} of {}", area, pixels));
    return floor > 1 ? std::max(floor, (pixels - area) / (1 + area)) : 1.0;
}

Tensor region_loss(const Tensor& map_sum, const RegionMasks& masks, double positive_weight) {
    check_map(map_sum, "region_loss");
    check_mask(masks.positive, map_sum, "M₊");
    check_mask(masks.negative, map_sum, "M₋");
    const Tensor outside = (map_sum.square() * masks.negative).mean();
    if (positive_weight == 0) return outside;
    return outside + ((1 - map_sum).square() * masks.positive).mean() * positive_weight;
}

Tensor opacity_loss(const Tensor& map, double threshold) {
    check_map(map, "opacity_loss");
    return map.mean().clamp_min(threshold);
}

double annealed(double start, double target, double iteration, double length) {
    if (length <= 0 || iteration >= length) return target;
    return start + (target - start) * std::max(0.0, iteration) / length;
}

Tensor binary_entropy(const Tensor& z) {
    if (!z.defined() || !z.is_floating_point())
        throw std::invalid_argument("binary_entropy: a tensor of floats is expected");
    return BinaryEntropy::apply(z);
}

Tensor entropy_loss(const Tensor& added) {
    check_map(added, "entropy_loss");
    return binary_entropy(added).mean();
}

}  // namespace fieldgraft
