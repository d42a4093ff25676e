// Blended compositing of a frozen medium o with an edit e along packed rays (Blending-NeRF, eqs. 4–7): reference
// kernels.
//
// Ray r owns samples start[r] … start[r+1]−1, nearest first. Optical depths a = σδ; aᵒ' = (1 − βσ) aᵒ; aᵝ = aᵒ' + aᵉ.
//   Tᵝ_k = exp(−Σ_{j<k} aᵝ_j)     φ(x) = (1 − e⁻ˣ)/x
//   weights, paper:       wᵒ = Tᵝ (1 − e^−aᵒ')    wᵉ = Tᵝ (1 − e^−aᵉ)        (sum > αᵝ where both media are dense)
//   weights, conserving:  wᵒ = Tᵝ aᵒ' φ(aᵝ)       wᵉ = Tᵝ aᵉ φ(aᵝ)           (sum = αᵝ)
//   color = Σ wᵒ cᵒ' + wᵉ cᵉ, cᵒ' = (1 − βc) cᵒ + βc cᵉ        color_edit = Σ (wᵒ βc + wᵉ) cᵉ   alpha_edit = Σ wᵒ βc +
//   wᵉ added = Σ wᵉ    changed = Σ wᵒ βc    removed: Σ (Tᵒ' − Tᵒ) αᵒ / Σ αᵒ, or `visible` Σ Tᵒ αᵒ βσ / Σ Tᵒ αᵒ (0 if
//   empty)
// An operation that is off has no branch in the loop (compile-time) and its pointers are never read or written.
//
// Each a is clamped to 1e30 before any sum or product; a clamped density gets gradient 0. Sums over a ray are in
// double. Relative error of T and of each weight: 1e-6 (1 + A) in float32, A the depth in front. Gradients: see
// blend_backward.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fieldgraft {

struct BlendMode {
    bool add = false, remove = false, change = false;
    bool conserving = false;  // compositing rule
    bool visible = false;     // which map `removed` is
};

// Inputs, N samples. density_e with add; color_e with add or change; beta_density with remove; beta_color with change.
template <class Real>
struct BlendInputs {
    const std::int64_t* start = nullptr;                                    // R+1
    const Real *delta = nullptr, *density_o = nullptr, *color_o = nullptr;  // N, N, N×3
    const Real *density_e = nullptr, *color_e = nullptr;                    // N, N×3
    const Real *beta_density = nullptr, *beta_color = nullptr;              // N, N
};

// Per ray; forward writes those of the operations that are on (transmittance and color always). In the backward pass
// the same struct with const pointers holds the incoming gradients; a null pointer is a gradient of zero.
template <class Real>
struct BlendRays {
    Real *color = nullptr, *transmittance = nullptr;                // R×3, R
    Real *color_edit = nullptr, *alpha_edit = nullptr;              // R×3, R
    Real *added = nullptr, *removed = nullptr, *changed = nullptr;  // R
};

template <class Real>
struct BlendHeads {  // gradients out, N or N×3; those of the operations that are on
    Real *density_e = nullptr, *color_e = nullptr, *beta_density = nullptr, *beta_color = nullptr;
};

// How exponentials are taken, a ray's samples together: out[i] = e^−x[i], and 1 − e^−x[i] without cancellation, x ≥ 0.
template <class Real>
struct BlendMath {
    void (*passed)(const Real* x, std::size_t n, Real* out);
    void (*covered)(const Real* x, std::size_t n, Real* out);
};
// The C library's, number by number. (exp_simd.h has vectors of them, within a few ε.)
template <class Real>
const BlendMath<Real>& library_math();

// Rays ray_begin … ray_end−1. Rays are independent: any split of the range gives the same bits.
template <class Real>
void blend_forward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<Real>& out,
                   std::int64_t ray_begin, std::int64_t ray_end, const BlendMath<Real>& math = library_math<Real>());

// Reverse recurrence over the samples (never "total minus what came before": it cancels behind opaque surfaces).
// color, color_edit, alpha_edit and transmittance give gradients to every head; added only to density_e (also through
// Tᵝ, βσ held), removed only to beta_density, changed only to beta_color (Tᵝ and aᵒ' held). None to o, none to delta.
template <class Real>
void blend_backward(const BlendMode& mode, const BlendInputs<Real>& in, const BlendRays<const Real>& grad,
                    const BlendHeads<Real>& out, std::int64_t ray_begin, std::int64_t ray_end,
                    const BlendMath<Real>& math = library_math<Real>());

}  // namespace fieldgraft
