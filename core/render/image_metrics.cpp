#include "core/render/image_metrics.h"

#include <cmath>

#include "core/base/shape.h"

namespace fieldgraft {
namespace {

constexpr std::int64_t window = 11;
constexpr double sigma = 1.5, c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;

void check(const Tensor& a, const Tensor& b) {
    if (a.dim() != 3 || a.sizes() != b.sizes() || a.numel() == 0) {
        throw std::invalid_argument("images to compare must be H×W×C of one size, not " + shape_text(a) + " and " +
                                    shape_text(b));
    }
}

// C×1×H×W in double.
Tensor planes(const Tensor& image) {
    return image.detach().to(at::kDouble).permute({2, 0, 1}).unsqueeze(1).contiguous();
}

Tensor gaussian() {
    const Tensor x = at::arange(window, at::kDouble) - (window - 1) / 2;
    const Tensor weights = at::exp(-x * x / (2 * sigma * sigma));
    return weights / weights.sum();
}

// Local means, of the pixels whose window lies inside.
Tensor smooth(const Tensor& image, const Tensor& weights) {
    return at::conv2d(at::conv2d(image, weights.view({1, 1, window, 1})), weights.view({1, 1, 1, window}));
}

}  // namespace

double psnr(const Tensor& a, const Tensor& b) {
    check(a, b);
    at::NoGradGuard no_grad;
    const double error = (a.to(at::kDouble) - b.to(at::kDouble)).square().mean().item<double>();
    return error > 0 ? -10 * std::log10(error) : std::numeric_limits<double>::infinity();
}

double ssim(const Tensor& a, const Tensor& b) {
    check(a, b);
    if (a.size(0) < window || a.size(1) < window) {
        throw std::invalid_argument("ssim needs images of at least 11×11 pixels, not " + shape_text(a));
    }
    at::NoGradGuard no_grad;
    const Tensor weights = gaussian(), x = planes(a), y = planes(b);
    const Tensor mean_x = smooth(x, weights), mean_y = smooth(y, weights);
    const Tensor variance_x = smooth(x * x, weights) - mean_x * mean_x;
    const Tensor variance_y = smooth(y * y, weights) - mean_y * mean_y;
    const Tensor covariance = smooth(x * y, weights) - mean_x * mean_y;
    const Tensor likeness = (2 * mean_x * mean_y + c1) * (2 * covariance + c2) /
                            ((mean_x * mean_x + mean_y * mean_y + c1) * (variance_x + variance_y + c2));
    return likeness.mean().item<double>();
}

}  // namespace fieldgraft
