// How alike two pictures are. Images H×W×C, same size, values in [0, 1]; computed in float64, no gradients.
//
//   psnr  −10 log₁₀ mean (a − b)²; infinite for equal images.
//   ssim  mean over pixels and channels of (2μaμb + C₁)(2σab + C₂) / ((μa² + μb² + C₁)(σa² + σb² + C₂)), C₁ = 0.01²,
//         C₂ = 0.03² (Wang et al. 2004): gaussian window σ 1.5, 11×11, weights sum to 1, population covariance, mean
//         over the pixels whose window lies inside the image (scikit-image: gaussian_weights=True,
//         use_sample_covariance=False).
// Errors are rounding only (~1e-12), except ssim of flat images, where variances cancel: absolute error ~1e-9.
#pragma once

#include "core/base/torch.h"

namespace fieldgraft {

double psnr(const Tensor& a, const Tensor& b);
// Throws std::invalid_argument for images smaller than 11×11.
double ssim(const Tensor& a, const Tensor& b);

}  // namespace fieldgraft
