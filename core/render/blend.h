// Blended volume rendering of the frozen field f and the editable field g (Blending-NeRF, eqs. 4–7), on packed samples.
//
//   σᵒ' = (1 − βσ) σᵒ    cᵒ' = (1 − βc) cᵒ + βc cᵉ    σᵝ = σᵒ' + σᵉ    αˣ = −expm1(−σˣ δ)    Tˣ_k = exp(−Σ_{j<k} σˣ_j
//   δ_j) color      Cᵝ = Σ Tᵝ (αᵒ' cᵒ' + αᵉ cᵉ)          color_edit  Cᵉ = Σ Tᵝ (αᵒ' βc + αᵉ) cᵉ added      Σ Tᵝ αᵉ
//   changed  Σ Tᵝ αᵒ' βc         transmittance  Tᵝ past the last sample (no background in any colour) removed "paper":
//   Σ (Tᵒ' − Tᵒ) αᵒ / Σ αᵒ     "visible": Σ Tᵒ αᵒ βσ / Σ Tᵒ αᵒ     (0 where the denominator is 0)
// Compositing "conserving" puts αᵝ σᵒ'/σᵝ and αᵝ σᵉ/σᵝ for αᵒ' and αᵉ: the weights then sum to αᵝ.
//
// Gradients: color and color_edit flow to every head. Localised maps flow to one head each: added → density_e only
// (also through Tᵝ, βσ detached); removed → beta_density only; changed → beta_color only. Nothing flows to f. A head
// that is off is an undefined tensor: its branch does not exist in the sample loop.
#pragma once

#include "core/field/edit_field.h"
#include "core/render/samples.h"

namespace fieldgraft {

enum class Compositing { paper, conserving };
enum class RemovedMap { paper, visible };

struct BlendOptions {
    Compositing compositing = Compositing::paper;
    RemovedMap removed = RemovedMap::paper;
};

struct BlendOut {
    Tensor color, color_edit;        // R×3
    Tensor added, removed, changed;  // R; undefined when the operation is off
    Tensor transmittance;            // R
    Tensor alpha_edit;  // R: Σ Tᵝ (αᵒ' βc + αᵉ), the weight of color_edit; undefined without change or add
};

// start (R+1), delta N, density_o N, color_o N×3; float32 or float64 throughout.
BlendOut blend(const Tensor& start, const Tensor& delta, const Tensor& density_o, const Tensor& color_o,
               const EditSamples& edit, const BlendOptions& options);

// The plain field: colour R×3 (no background), transmittance R, depth R; differentiable in density and color.
struct CompositeOut {
    Tensor color, transmittance, depth;
};
CompositeOut composite(const Tensor& start, const Tensor& delta, const Tensor& t, const Tensor& density,
                       const Tensor& color);

}  // namespace fieldgraft
