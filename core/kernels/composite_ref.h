// Plain emission-absorption compositing along packed rays (Max 1995; Blending-NeRF, sec. 3): reference kernel.
//
//   a_k = min(σ_k δ_k, 1e30)   T_k = exp(−Σ_{j<k} a_j)   α_k = −expm1(−a_k)   w_k = T_k α_k
//   color = Σ w_k c_k    transmittance = exp(−Σ a_k)    depth = Σ w_k t_k / Σ w_k (0 on a ray without weight)
//
// Layout: ray r owns samples start[r] … start[r+1]−1, nearest first; colours N×3 and R×3 row-major; lengths in model
// units. Differentiable in density and colour, through color and transmittance; depth is not differentiated. Backward
// is a reverse sum: ∂L/∂a_k = T_{k+1} g·c_k − B_k, B_{k−1} = B_k + w_k g·c_k, B_K = g_T T_{K+1}: nothing cancels behind
// an opaque sample. Sums over a ray are in double; relative error of T ≤ 1e-6 (1 + A) in float, A = Σ a.
// Rays are split between threads; bits do not depend on the split.
#pragma once

#include <cstdint>
#include <span>

#include "core/kernels/parallel.h"

namespace fieldgraft {

template <class T>
struct CompositeInput {
    std::span<const std::int64_t> start;  // R+1
    std::span<const T> delta, t;          // N
    std::span<const T> density;           // N, ≥ 0 (inf allowed)
    std::span<const T> color;             // N×3
};

template <class T>
void composite_forward(const CompositeInput<T>& input, std::span<T> color, std::span<T> transmittance,
                       std::span<T> depth, const ParallelFor& parallel_for);

// density_grad N and color_grad N×3 are written, not added to.
template <class T>
void composite_backward(const CompositeInput<T>& input, std::span<const T> color_out_grad,
                        std::span<const T> transmittance_grad, std::span<T> density_grad, std::span<T> color_grad,
                        const ParallelFor& parallel_for);

}  // namespace fieldgraft
