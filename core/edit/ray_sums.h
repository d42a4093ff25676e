// Transmittances, weights and sums along packed rays, in tensor operations and without gradients.
//
// start (R+1) int64; ray, delta, density N. T before sample k = exp(−Σ_{j<k} σ δ), summed in double; α = −expm1(−σδ).
// Depths count for at most 100 a sample (nothing passes) so that an opaque ray leaves the digits of those after it
// alone.
#pragma once

#include "core/base/torch.h"

namespace fieldgraft {

Tensor transmittance_before(const Tensor& start, const Tensor& ray, const Tensor& delta, const Tensor& density);  // N
Tensor sample_weights(const Tensor& start, const Tensor& ray, const Tensor& delta, const Tensor& density);  // N: T α
// Σ over each ray's samples of `values` (N or N×C): R or R×C.
Tensor sum_over_rays(const Tensor& values, const Tensor& ray, std::int64_t rays);

}  // namespace fieldgraft
