// Losses between embeddings (Blending-NeRF, sec. 4.2): with D(a, b) = 1 − cosine(a, b),
//
//   global       mean over copies n of D(E(I_n), T)                                      (whether the picture shows the
//   target) directional  mean over copies n of D(ê(Iᵝ_n) − ê(Iᵒ_n), t̂_target − t̂_source),  ê = e / |e|   (whether it
//   moved that way)
//
// Embeddings are N×D of any length; they are brought to length 1 before a difference is taken. Cosines use softened
// norms √(|v|² + ε²): for differences ε = 1e-2, because Iᵝ starts as Iᵒ, where a plain norm has a 0/0 and a tiny ε a
// first gradient of 1/ε that sits in Adam's second moment for thousands of steps. So |∂L/∂ê| ≤ 1/ε, and the loss at Iᵝ
// = Iᵒ is exactly 1. Differentiable in every image embedding; texts are constants. All in the inputs' floating type.
#pragma once

#include "core/base/torch.h"

namespace fieldgraft {

inline constexpr double difference_epsilon = 1e-2;

// √(Σ v² + ε²) over the last dimension, which is kept with size 1.
Tensor soft_norm(const Tensor& v, double epsilon);
// v / soft_norm(v, 1e-12): length 1 (and 0, finite, for v = 0).
Tensor to_unit(const Tensor& v);
// Σ ab / (soft_norm(a)·soft_norm(b)) over the last dimension; shapes broadcast. In [−1, 1].
Tensor soft_cosine(const Tensor& a, const Tensor& b, double epsilon);

// The mean of texts' unit embeddings (one per template), brought to length 1 again: M×D → D.
Tensor mean_text(const Tensor& texts);

// images N×D, text D → scalar in [0, 2].
Tensor global_loss(const Tensor& images, const Tensor& text);
// before, after N×D (the same augmentation in the same row), source, target D → scalar in [0, 2].
// Throws InputError if the two texts coincide (|Δt| < 1e-5): they leave no direction.
Tensor directional_loss(const Tensor& before, const Tensor& after, const Tensor& source, const Tensor& target,
                        double epsilon = difference_epsilon);

}  // namespace fieldgraft
