// The localised losses: where an edit acts, how much, and how crisply (Blending-NeRF, sec. 4.3 and appendix B).
//
//   region   MSE(0, M₋ ⊙ E_sum) + λ₊ · mean(M₊ ⊙ (1 − E_sum)²)     means over all S² pixels, not over the masked ones;
//            the second target is 1 inside M₊ only (outside, the published formula adds a constant)
//   λ₊       max(30, (S² − area M₊) / (1 + area M₊)) with add, else 1
//   opacity  max(τ, mean E)    for each map that is on;  τ annealed linearly from its start to its target
//   reg      mean H(E_add),    H(z) = −z log₂ z − (1 − z) log₂(1 − z)
//
// Maps are S×S float32 or float64, values about [0, 1]; masks are S×S bool. Gradients flow into the maps (what they
// reach is the renderer's matter); masks and thresholds get none. H is 0 at z ∈ {0, 1}, never NaN for a z a hair
// outside, and its gradient is bounded by 20. An empty M₊ contributes 0.
#pragma once

#include "core/base/torch.h"

namespace fieldgraft {

struct RegionMasks {
    Tensor positive, negative;  // M₊, M₋: S×S bool, disjoint
};

// λ₊ for a region of `area` pixels out of `pixels`; `floor` is 30 with add, 1 else (1 means: always 1).
double positive_weight(double area, double pixels, double floor);
Tensor region_loss(const Tensor& map_sum, const RegionMasks& masks, double positive_weight);

// max(τ, mean E): its gradient is 0 while the mean is below τ.
Tensor opacity_loss(const Tensor& map, double threshold);
// Linear from `start` at iteration 0 to `target` at `length`, then constant.
double annealed(double start, double target, double iteration, double length);

Tensor binary_entropy(const Tensor& z);
Tensor entropy_loss(const Tensor& added);

}  // namespace fieldgraft
